# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
An OPC UA server in its own process: `python opcua_server.py PORT VALVES [options]`.

A line on its standard input, such as `LV0.PV 0.7 Double 0 2026-03-29T01:00:00+00:00`, writes a
value with type, status code and source time ("-": now).
"""

import argparse
import asyncio
import math
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

from asyncua import Server, ua
from asyncua.crypto.permission_rules import SimpleRoleRuleset, User, UserRole
from asyncua.server.internal_session import InternalSession
from asyncua.server.user_managers import UserManager

SIGNALS = ('CV', 'PV', 'P1', 'P2', 'T1', 'FLOW', 'PS')
JUDGED = (  # nodes for what others find out
    ('HEALTH', -1, ua.VariantType.Int32),
    ('FAULT', False, ua.VariantType.Boolean),
    ('RATIO', -1.0, ua.VariantType.Double),
    ('CAUSE', 'nothing yet', ua.VariantType.String),
    ('BEAT', 0, ua.VariantType.UInt16),
    ('OTHER', -1.0, ua.VariantType.Double),
    ('LOCKED', -1.0, ua.VariantType.Double),
)
START = (0.5, 0.5, 35.0, 26.0, 20.0, 5.0, 1.0)


class OneUser(UserManager):
    def get_user(self, iserver, username=None, password=None, certificate=None):
        if username == 'reader' and password == 'open sesame 42':
            return User(role=UserRole.User)
        return None


def take_at_most(most: int) -> None:
    """Refuse a request that has more items than a server takes, as small controllers do."""
    for service, items in (
        ('create_monitored_items', 'ItemsToCreate'),
        ('read', 'NodesToRead'),
        ('write', 'NodesToWrite'),
        ('browse', 'NodesToBrowse'),
    ):

        async def limited(session, given, inner=getattr(InternalSession, service), items=items):
            if len(getattr(given, items)) > most:
                raise ua.UaStatusCodeError(ua.StatusCodes.BadTooManyOperations)
            return await inner(session, given)

        setattr(InternalSession, service, limited)


async def refuse(*_) -> None:
    raise ua.UaStatusCodeError(ua.StatusCodes.BadServiceUnsupported)


async def main() -> None:
    p = argparse.ArgumentParser()
    p.add_argument('port', type=int)
    p.add_argument('valves', type=int)
    p.add_argument('--rate', type=float, default=0.0, help='of changes of every signal [Hz]')
    p.add_argument('--fast', type=int, default=0, help='further valves that change at 50 Hz')
    p.add_argument('--signals', type=int, default=7, help='of each valve that change')
    p.add_argument('--behind', type=float, default=0.0, help='share of time it falls behind by')
    p.add_argument('--at-once', type=int, default=0, help='most items of one request')
    p.add_argument('--always-report', action='store_true', help='has no SetMonitoringMode')
    p.add_argument('--user', action='store_true')
    p.add_argument('--certificates', type=Path)
    options = p.parse_args()
    server = Server(user_manager=OneUser() if options.user else None)
    await server.init()
    server.set_endpoint(f'opc.tcp://127.0.0.1:{options.port}')
    policies = [ua.SecurityPolicyType.NoSecurity]
    if options.certificates:
        policies = [ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt]
        await server.load_certificate(str(options.certificates / 'server.der'))
        await server.load_private_key(str(options.certificates / 'server.pem'))
    server.set_security_policy(policies, permission_ruleset=SimpleRoleRuleset())
    space = await server.register_namespace('urn:plant')
    slow, fast = [], []
    for number in range(options.valves + options.fast):
        valve = await server.nodes.objects.add_object(space, f'LV{number}')
        for name, value in zip(SIGNALS, START, strict=True):
            node = await valve.add_variable(f'ns={space};s=LV{number}.{name}', name, value)
            await node.set_writable()
            if SIGNALS.index(name) < options.signals:
                (slow if number < options.valves else fast).append(node)
    judged = await server.nodes.objects.add_object(space, 'FD')
    for name, value, kind in JUDGED:
        node = await judged.add_variable(f'ns={space};s=FD.{name}', name, value, kind)
        if name != 'LOCKED':
            await node.set_writable()
    if options.at_once:
        ids = ua.ObjectIds
        for limit in (
            ids.Server_ServerCapabilities_OperationLimits_MaxMonitoredItemsPerCall,
            ids.Server_ServerCapabilities_OperationLimits_MaxNodesPerRead,
            ids.Server_ServerCapabilities_OperationLimits_MaxNodesPerWrite,
            ids.Server_ServerCapabilities_OperationLimits_MaxNodesPerBrowse,
        ):
            await server.get_node(ua.NodeId(limit)).write_value(
                options.at_once, ua.VariantType.UInt32
            )
        take_at_most(options.at_once)
    if options.always_report:
        InternalSession.set_monitoring_mode = refuse
    # let it lie about types, as some servers do
    server.iserver.aspace._is_expected_variant_type = lambda *given: True
    write = server.iserver.aspace.write_attribute_value

    async def change(nodes, period: float) -> None:
        loop = asyncio.get_running_loop()
        origin = datetime.now(UTC).replace(microsecond=0) + timedelta(seconds=1)
        await asyncio.sleep(max(0.0, (origin - datetime.now(UTC)).total_seconds()))
        due, n = loop.time(), 0
        while True:
            stamp = origin + timedelta(microseconds=round(n * period * 1e6))
            for k, node in enumerate(nodes):
                value = 0.5 + 0.3 * math.sin(0.01 * n + k) + 1e-6 * n
                await write(
                    node.nodeid,
                    ua.AttributeIds.Value,
                    ua.DataValue(
                        ua.Variant(value, ua.VariantType.Double),
                        SourceTimestamp=stamp,
                        ServerTimestamp=stamp,
                    ),
                )
            n += 1
            due += period / (1.0 - options.behind)
            await asyncio.sleep(max(0.0, due - loop.time()))

    async def obey() -> None:
        loop = asyncio.get_running_loop()
        while line := await loop.run_in_executor(None, sys.stdin.readline):
            name, value, kind, status, when = line.split()
            stamp = datetime.now(UTC) if when == '-' else datetime.fromisoformat(when)
            variant = ua.VariantType[kind]
            content = value * 1000 if variant is ua.VariantType.String else float(value)
            await write(
                ua.NodeId(name, space),
                ua.AttributeIds.Value,
                ua.DataValue(
                    ua.Variant(content, variant),
                    ua.StatusCode(int(status, 0)),
                    SourceTimestamp=stamp,
                    ServerTimestamp=stamp,
                ),
            )

    async with server:
        print('ready', flush=True)
        jobs = []
        if options.rate:
            jobs.append(asyncio.create_task(change(slow, 1.0 / options.rate)))
        if options.fast:
            jobs.append(asyncio.create_task(change(fast, 0.02)))
        await asyncio.gather(obey(), *jobs)
        await asyncio.Event().wait()


if __name__ == '__main__':
    asyncio.run(main())
