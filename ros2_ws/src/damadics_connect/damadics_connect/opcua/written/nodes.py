# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Which nodes of the plant's own server take judgements, and what each of them is given."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from asyncua import ua
from damadics_fd.core.sample import SIGNALS

from damadics_connect.judgement import Judgement
from damadics_connect.opcua.address_space import HEALTH
from damadics_connect.settings import Section
from damadics_connect.valve_list import ValveSource

Value = float | int | bool | str
HEARTBEAT = 'heartbeat'
TURN = 1 << 15  # the heartbeat begins anew there, so that it fits into every integer type
LONGEST_TEXT = 200  # characters
WHOLE = frozenset(ua.VariantType(n) for n in range(2, 10))  # SByte .. UInt64
REAL = frozenset({ua.VariantType.Float, ua.VariantType.Double})
ANY = ua.VariantType.Variant  # of nodes that take any number
# what of a judgement may be written; running numbers of a valve that nobody judges are NaN
OUTPUTS: Mapping[str, Callable[[Judgement], Value]] = {
    'health': lambda j: HEALTH[j.ne107],
    'fault': lambda j: j.fault,
    'acknowledged': lambda j: j.acknowledged,
    'occurrence': lambda j: j.occurrence,
    'residual': lambda j: _fresh(j, j.residual),
    'limit': lambda j: _fresh(j, j.threshold),
    'ratio': lambda j: _fresh(j, j.ratio),
    'confidence': lambda j: j.confidence,
    'size': lambda j: j.strength,
    'state': lambda j: j.state,
    'cause': lambda j: j.cause,
    'text': lambda j: j.text[:LONGEST_TEXT],
    'advice': lambda j: j.advice[:LONGEST_TEXT],
}


class PlantNode(NamedTuple):
    """A node and what is written to it."""

    valve: str  # '' for the heartbeat
    output: str  # one of OUTPUTS, or HEARTBEAT
    node: str  # as the configuration names it

    @property
    def name(self) -> str:
        """What it is, for messages."""
        return f'{self.valve}.{self.output}' if self.valve else self.output

    def value(self, judgements: Mapping[str, Judgement], beat: int) -> Value:
        """
        Return what is to be written.

        :param judgements: by valve; one that is not in it is not monitored.
        :param beat: seconds since the start.
        :return: the value.
        """
        if not self.valve:
            return beat % TURN
        return OUTPUTS[self.output](judgements.get(self.valve) or Judgement(self.valve))


def _fresh(judgement: Judgement, value: float) -> float:
    return math.nan if judgement.state in ('not_monitored', 'unknown') else value


def read_plant_nodes(config: Section, valves: Sequence[ValveSource]) -> list[PlantNode]:
    """
    Read the entry `write`.

    :param config: the whole file.
    :param valves: that are read from the same server.
    :return: the nodes; mistakes are noted in `config`.
    """
    if 'write' not in config:
        config.section('write')
        return []
    section = config.section('write')
    found = []
    if beat := section.text(HEARTBEAT):
        found.append(PlantNode('', HEARTBEAT, beat))
    for valve, entry in section.sections('valves').items():
        for output in OUTPUTS:
            if node := entry.text(output):
                found.append(PlantNode(valve, output, node))
        entry.done()
    section.done()
    if not found and not section.problems:
        section.problems.append('write: names no node')
    taken = {
        signal.source: f'read as {SIGNALS[signal.slot]} of {valve.name}'
        for valve in valves
        for signal in valve.signals
    }
    for each in found:
        if each.node in taken:
            section.problems.append(
                f'write: {each.name}: {each.node[:60]} is {taken[each.node]}: a node is read or '
                'written, by one only'
            )
        taken[each.node] = f'written as {each.name}'
    return found


def fitted(value: Value, kind: ua.VariantType) -> ua.Variant | None:
    """
    Return a value as a node takes it.

    :param value: of a judgement.
    :param kind: of the node; `Variant` for any number.
    :return: the value; None where the node cannot hold it.
    """
    if isinstance(value, str):
        return ua.Variant(value, kind) if kind is ua.VariantType.String else None
    if kind is ua.VariantType.Boolean:
        return ua.Variant(value, kind) if isinstance(value, bool) else None
    if kind in REAL:
        return ua.Variant(float(value), kind)
    if kind is ANY:
        own = ua.VariantType.Double if isinstance(value, float) else ua.VariantType.Int32
        return ua.Variant(value if isinstance(value, float) else int(value), own)
    if kind in WHOLE and not isinstance(value, float):
        return ua.Variant(int(value), kind)
    return None


def wanted_type(output: str) -> str:
    """
    Say which types of a node can hold an output.

    :param output: its name.
    :return: for a message.
    """
    example = OUTPUTS[output](Judgement('')) if output in OUTPUTS else 0
    if isinstance(example, str):
        return 'String'
    if isinstance(example, bool):
        return 'Boolean or a number'
    return 'Double or Float' if isinstance(example, float) else 'an integer, Double or Float'
