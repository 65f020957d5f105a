# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The devices of Sparkplug B edge nodes: births, data and deaths."""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass

from aiomqtt import Client, Message
from damadics_fd.core.sample import SIGNALS

from damadics_connect.mqtt.followed_valve import FollowedValve
from damadics_connect.mqtt.json_sample import LATEST, UNITS, limited
from damadics_connect.mqtt.sparkplug import (
    NAMESPACE,
    REBIRTH,
    birth_of,
    number_of,
    read_payload,
    write_payload,
)

AGAIN = 5.0  # s between two requests for a birth certificate
SEQUENCE = 256


@dataclass
class Edge:
    """What is known of one edge node."""

    birth: int | None = None  # number of its birth, as its death will have it
    sequence: int | None = None  # of its last message
    wanted: bool = False  # it is to be born again, as something was missed
    asked: float = -math.inf  # monotonic time [s]
    lost: int = 0  # messages


class Devices:
    """
    The valves that are devices of edge nodes.

    :param valves: by `spBv1.0/GROUP/NODE/DEVICE`.
    """

    def __init__(self, valves: Mapping[str, list[FollowedValve]]) -> None:
        self._valves = {t: v for t, v in valves.items() if t.startswith(f'{NAMESPACE}/')}
        self._edges = {_edge_of(topic): Edge() for topic in self._valves}

    @property
    def lost(self) -> int:
        """Messages that edge nodes have sent and we have not got."""
        return sum(edge.lost for edge in self._edges.values())

    def topics(self) -> set[str]:
        """Return what to subscribe to."""
        found = set()
        for topic in self._valves:
            _, group, node, device = topic.split('/')
            found |= {
                f'{NAMESPACE}/{group}/+/{node}/{device}',
                f'{NAMESPACE}/{group}/+/{node}',
            }
        return found

    def begin(self) -> None:
        """Begin a connection: a device at rest says nothing by itself, so births are asked for."""
        for key in self._edges:
            self._edges[key] = Edge(wanted=True)
        self.end()

    def end(self) -> None:
        """End a connection: no device is known to live."""
        for those in self._valves.values():
            for valve in those:
                valve.alive = False

    async def ask(self, client: Client, *, at_first: bool = False) -> None:
        """
        Ask edge nodes for their names and values, as we have missed some; call it often.

        :param client: connected.
        :param at_first: whoever was not there to hear it may be asked once more right away.
        """
        for (group, node), edge in self._edges.items():
            if edge.wanted and time.monotonic() - edge.asked >= AGAIN:
                edge.wanted = False
                edge.asked = -math.inf if at_first else time.monotonic()
                request = write_payload({REBIRTH: True}, time.time_ns() // UNITS['ms'], None)
                await client.publish(f'{NAMESPACE}/{group}/NCMD/{node}', request, qos=0)

    def take(self, message: Message) -> None:
        """
        Take one message of an edge node or one of its devices.

        :param message: as it came; one that is retained is of a time before ours.
        """
        _, group, kind, node, *device = str(message.topic).split('/')
        edge = self._edges.get((group, node))
        if edge is None or message.retain or kind not in _KINDS:
            return
        valves = self._valves.get(f'{NAMESPACE}/{group}/{node}/{device[0]}', []) if device else []
        try:
            payload = read_payload(limited(message.payload))
        except ValueError as problem:
            for valve in valves:
                valve.refused = str(problem)
            return
        if kind == 'NDEATH':
            if edge.birth is None or birth_of(payload) in (None, edge.birth):
                self._die(group, node)
            edge.wanted = True  # whoever lives in spite of it says so
            return
        if kind == 'DDEATH':
            for valve in valves:
                _die(valve)
        elif kind == 'NBIRTH':
            edge.birth, edge.sequence = birth_of(payload), None
            self._die(group, node)  # each of its devices is born anew
        if payload.HasField('seq'):
            self._count(edge, payload.seq, born=kind == 'NBIRTH')
        if kind.startswith('D') and kind != 'DDEATH':
            for valve in valves:
                edge.wanted |= self._take(valve, payload, born=kind == 'DBIRTH')

    def _count(self, edge: Edge, sequence: int, *, born: bool) -> None:
        """Notice that something was missed."""
        if edge.sequence is not None and sequence != (edge.sequence + 1) % SEQUENCE and not born:
            edge.lost += (sequence - edge.sequence - 1) % SEQUENCE
            edge.wanted = True
        edge.sequence = sequence

    def _die(self, group: str, node: str) -> None:
        for topic, those in self._valves.items():
            if _edge_of(topic) == (group, node):
                for valve in those:
                    _die(valve)

    def _take(self, valve: FollowedValve, payload, *, born: bool) -> bool:  # type: ignore[no-untyped-def]
        """Take the metrics of a valve; return whether its birth was missed."""
        now = time.monotonic_ns()
        valve.refused = ''
        if born:
            valve.aliases = {m.alias: m.name for m in payload.metrics if m.HasField('alias')}
            valve.joiner.begin(now)
            valve.alive = True
        missed = not valve.alive
        rows = []
        for metric in payload.metrics:
            name = metric.name or valve.aliases.get(metric.alias, '')
            missed |= not name  # an alias that no birth has told
            if metric.is_historical or name not in valve.fields:
                continue
            told = (metric.timestamp or payload.timestamp) * UNITS['ms']
            valve.unstamped += not told
            stamp = told or time.time_ns()
            if stamp < LATEST:
                rows.append((stamp, name, number_of(metric)))
            else:
                valve.refused = 'a time beyond all measure'
        for stamp, name, value in sorted(rows, key=lambda row: row[0]):
            signal = valve.fields[name]
            key = SIGNALS[signal.slot]
            if math.isnan(value):
                valve.joiner.tally.bad[key] = 'null, of bad quality or no number'
            else:
                valve.joiner.tally.bad.pop(key, None)
            valve.joiner.source_clock(payload.timestamp * UNITS['ms'] or stamp, now)
            valve.joiner.take(signal.slot, stamp, signal.scale(value), now)
        return missed


_KINDS = ('NBIRTH', 'NDATA', 'NDEATH', 'DBIRTH', 'DDATA', 'DDEATH')


def _edge_of(topic: str) -> tuple[str, str]:
    _, group, node, _ = topic.split('/')
    return group, node


def _die(valve: FollowedValve) -> None:
    valve.alive = False
    valve.aliases.clear()
