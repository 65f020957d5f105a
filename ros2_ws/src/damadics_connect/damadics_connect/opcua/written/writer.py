# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Judgements out: written into nodes of the plant's own server, those and no others."""

import asyncio
import contextlib
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from asyncua import Client, ua
from asyncua.common.ua_utils import data_type_to_variant_type
from damadics_fd.ros.diagnostics import Level, Report
from rclpy.node import Node as RosNode

from damadics_connect.health import some
from damadics_connect.judgement import Judgement
from damadics_connect.opcua.limits import Limits, limits_of
from damadics_connect.opcua.session import Connection, Endpoint
from damadics_connect.opcua.values import node_of
from damadics_connect.opcua.written.nodes import PlantNode, Value, fitted, wanted_type
from damadics_connect.watch import Watch

LOOK = 0.1  # s between two looks at what has changed
NUMBERS = 1.0  # s between two updates of running numbers, and beats
LAST_WORD = 5.0  # s for the last values when this process ends, on a busy machine too
CURRENT_WRITE = 0x02  # of an access level
BAD = 0x80000000


class Place(NamedTuple):
    """A node that may be written."""

    node: PlantNode
    id: ua.NodeId
    kind: ua.VariantType


class PlantWriter:
    """
    What is written into a server of others.

    A value is written when it has changed, running numbers once a second at most. Whoever ends
    this process leaves every valve as not monitored behind; where it is killed, the heartbeat
    stands still.

    :param endpoint: the server.
    :param nodes: what is written where.
    :param node: of ROS 2.
    :param log: takes what a person should know.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        nodes: Sequence[PlantNode],
        node: RosNode,
        log: Callable[[str], None],
    ) -> None:
        self._connection = Connection(endpoint, self._use, log, 'judgements are not written')
        self._nodes = nodes
        self._log = log
        self._watch = Watch(node, lambda judgement: self._changed.add(judgement.valve))
        self._changed: set[str] = set()
        self._written: dict[PlantNode, Value] = {}
        self._refused: dict[PlantNode, str] = {}
        self._told: dict[PlantNode, str] = {}
        self._most = Limits().writes
        self._count = 0

    async def run(self) -> None:
        """Write for ever; connect again whenever the server was lost."""
        await self._connection.run()

    async def _use(self, client: Client) -> None:
        """Write in one session, until it ends."""
        self._most = (await limits_of(client)).writes
        places = await self._find(client)
        self._connection.works()
        await self._write_on(client, places)

    def report(self) -> Report:
        """Say how it is."""
        refused = [f'{node.name} ({cause})' for node, cause in self._refused.items()]
        values = {
            'Server': self._connection.place,
            'Nodes': len(self._nodes),
            'Nodes refused': len(refused),
            'Values written': self._count,
        }
        if self._connection.fault:
            return Level.ERROR, self._connection.fault, values
        if refused:
            return Level.WARN, f'not written: {some(refused)}', values
        return Level.OK, f'{len(self._nodes)} node(s) are written', values

    async def _find(self, client: Client) -> list[Place]:
        """Look at every node: is it there, may it be written, does it hold what it is given."""
        spaces = await client.get_namespace_array()
        self._refused.clear()
        self._written.clear()
        places = []
        for node in self._nodes:
            nodeid = node_of(node.node, spaces)
            if nodeid is None:
                self._refuse(node, 'not a node id such as ns=2;s=NAME')
                continue
            try:
                kind = await self._kind(client, nodeid)
            except ua.UaStatusCodeError as problem:
                name = type(problem).__name__
                self._refuse(node, 'no such node' if 'NodeId' in name else name)
                continue
            if isinstance(kind, str):
                self._refuse(node, kind)
            elif fitted(node.value({}, 0), kind) is None:
                self._refuse(node, f'is {kind.name}: has to be {wanted_type(node.output)}')
            else:
                places.append(Place(node, nodeid, kind))
        self._tell_refused()
        self._log(f'writing judgements to {len(places)} node(s) of {self._connection.place}')
        return places

    async def _kind(self, client: Client, nodeid: ua.NodeId) -> ua.VariantType | str:
        """Return the type of a variable that we may write, or why it is none."""
        node = client.get_node(nodeid)
        wanted = (ua.AttributeIds.NodeClass, ua.AttributeIds.UserAccessLevel)
        kind, access = await node.read_attributes(wanted)
        if kind.StatusCode is not None:
            kind.StatusCode.check()
        if kind.Value is None or kind.Value.Value != ua.NodeClass.Variable:
            return 'is no variable'
        level = access.Value.Value if access.Value is not None else 0
        if not isinstance(level, int) or not level & CURRENT_WRITE:
            return 'the server does not let us write it'
        return await data_type_to_variant_type(client.get_node(await node.read_data_type()))

    def _refuse(self, node: PlantNode, cause: str) -> None:
        self._refused[node] = f'{node.node[:60]}: {cause}'

    def _tell_refused(self) -> None:
        """Tell the log what is new among the refused."""
        new = [f'{n.name} ({c})' for n, c in self._refused.items() if self._told.get(n) != c]
        if new:
            others = len(self._refused) < len(self._nodes)
            self._log(f'not written: {some(new)}; {"all others are" if others else "no other is"}')
        self._told = dict(self._refused)

    async def _write_on(self, client: Client, places: Sequence[Place]) -> None:
        """Write what has changed until the session ends."""
        of_valve: dict[str, list[Place]] = {}
        for place in places:
            of_valve.setdefault(place.node.valve, []).append(place)
        due = 0.0
        try:
            while True:
                names, self._changed = self._changed, set()
                if time.monotonic() >= due:
                    due = time.monotonic() + NUMBERS
                    names |= of_valve.keys()
                some_of = [place for name in sorted(names) for place in of_valve.get(name, ())]
                await self._write(client, some_of, self._watch.valves)
                await asyncio.sleep(LOOK)
        except asyncio.CancelledError:
            own = [place for place in places if place.node.valve]
            gone = {name: judgement.silent() for name, judgement in self._watch.valves.items()}
            with contextlib.suppress(Exception):  # it ends all the same
                await asyncio.wait_for(self._write(client, own, gone), LAST_WORD)
            raise

    async def _write(
        self, client: Client, places: Sequence[Place], judgements: dict[str, Judgement]
    ) -> None:
        """Write those values that differ from what was written last."""
        beat = int(time.monotonic())
        new = []
        for place in places:
            value = place.node.value(judgements, beat)
            last = self._written.get(place.node)
            if place.node in self._refused or value == last or (value != value and last != last):
                continue
            if (variant := fitted(value, place.kind)) is not None:
                new.append((place, value, variant))
        for begin in range(0, len(new), self._most):
            part = new[begin : begin + self._most]
            results = await client.uaclient.session.write(
                ua.WriteParameters(
                    NodesToWrite=[
                        ua.WriteValue(
                            NodeId=place.id,
                            AttributeId=ua.AttributeIds.Value,
                            Value=ua.DataValue(variant),
                        )
                        for place, _, variant in part
                    ]
                )
            )
            for (place, value, _), status in zip(part, results, strict=True):
                if status.value & BAD:
                    self._refuse(place.node, status.name)
                else:
                    self._written[place.node] = value
                    self._count += 1
        if len(self._refused) != len(self._told):
            self._tell_refused()
