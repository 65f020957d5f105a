# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `opcua_plant`: simulated valves behind a real OPC UA server."""

import argparse
import asyncio
import contextlib
import logging
import signal
import sys
import time
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

from asyncua import Node, Server, ua
from damadics_connect.opcua.values import data_value, node_id
from damadics_fd.ros.arguments import command_parser
from damadics_plant import Simulator

from damadics_bringup.demo_plant.tags import TAGS

EXAMPLE = """example:
  ros2 run damadics_bringup opcua_plant --port 4840
then write 4 to the variable LV103.Fault: friction; 0 clears it."""
BLOCK = 0.1  # s simulated at once


class SimulatedValve:
    """
    One valve and its variables.

    :param tag: of the valve.
    :param seed: of its noise and its set-points.
    :param rate: of its samples [Hz].
    """

    def __init__(self, tag: str, seed: int, rate: float) -> None:
        self.tag = tag
        self._simulator = Simulator(
            'random_nominal', rate=rate, model='lugre', noise=True, seed=seed, duration=1e7
        )
        self._nodes: dict[str, ua.NodeId] = {}
        self._fault: Node
        self._injected = 0

    async def make(self, server: Server, space: int) -> None:
        """Make the variables."""
        folder = await server.nodes.objects.add_object(space, self.tag)
        for signal_name, (end, _) in TAGS.items():
            node = await folder.add_variable(
                node_id(f'{self.tag}.{end}', space), ua.QualifiedName(end, space), 0.0
            )
            self._nodes[signal_name] = node.nodeid
        self._fault = await folder.add_variable(
            node_id(f'{self.tag}.Fault', space),
            ua.QualifiedName('Fault', space),
            0,
            ua.VariantType.Int32,
        )
        await self._fault.set_writable()

    async def advance(self, server: Server, origin: datetime, samples: int) -> None:
        """Simulate the next samples and write them with their own time."""
        wanted = await self._fault.read_value()
        if wanted != self._injected:
            self._injected = wanted
            self._simulator.clear()
            if wanted:
                self._simulator.inject(f'f{wanted}', 1.0, 0.0)
        columns = self._simulator.advance(samples)
        write = server.iserver.aspace.write_attribute_value
        for n, stamp in enumerate(columns['stamp'].tolist()):
            when = origin + timedelta(microseconds=stamp // 1000)
            for name, (_, factor) in TAGS.items():
                number = ua.Variant(float(columns[name][n]) * factor, ua.VariantType.Double)
                value = data_value(number, when, when)
                await write(self._nodes[name], ua.AttributeIds.Value, value)


async def serve(options: argparse.Namespace) -> None:
    """
    Serve until cancelled.

    :param options: the command line.
    """
    server = Server()
    await server.init()
    server.set_endpoint(f'opc.tcp://{options.host}:{options.port}')
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    space = await server.register_namespace('urn:damadics:simulated-plant')
    valves = [SimulatedValve(f'LV{101 + n}', n + 1, options.rate) for n in range(options.valves)]
    for valve in valves:
        await valve.make(server, space)
    samples = max(1, round(BLOCK * options.rate))
    async with server:
        print(f'plant at opc.tcp://{options.host}:{options.port}', flush=True)
        origin, began, n = datetime.now(UTC), time.monotonic(), 0
        while True:
            for valve in valves:
                await valve.advance(server, origin, samples)
            n += samples
            await asyncio.sleep(max(0.0, began + n / options.rate - time.monotonic()))


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser('opcua_plant', 'Serve simulated valves over OPC UA.', EXAMPLE)
    p.add_argument('--host', default='127.0.0.1', help='address (127.0.0.1)')
    p.add_argument('--port', type=int, default=4840, help='port (4840)')
    p.add_argument('--valves', type=int, default=3, help='number of valves (3)')
    p.add_argument('--rate', type=float, default=50.0, help='samples per second (50)')
    return p


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    options = parser().parse_args(args)
    logging.getLogger('asyncua').setLevel(logging.ERROR)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(serve(options))
    return 0


if __name__ == '__main__':
    sys.exit(main())
