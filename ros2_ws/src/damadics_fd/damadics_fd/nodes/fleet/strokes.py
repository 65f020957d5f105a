# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Partial strokes of the valves of a fleet that allow them, each served in its own namespace."""

from collections.abc import Callable
from functools import partial

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.nodes.fleet.keeping import Keeping
from damadics_fd.nodes.fleet.members import Members
from damadics_fd.nodes.operator import OperatorActions
from damadics_fd.nodes.partial_strokes import PartialStrokes
from damadics_fd.ros.entities import Entities


class FleetStrokes:
    """
    Serve `partial_stroke` and publish `stroke_request` for each valve that allows it.

    :param entities: of the fleet's node.
    :param actions: the record of what people do.
    :param members: the valves.
    :param keeping: their detectors.
    :param blind: tells of the number of a valve whether its judgement says nothing about now.
    """

    def __init__(
        self,
        entities: Entities,
        actions: OperatorActions,
        members: Members,
        keeping: Keeping,
        blind: Callable[[int], bool],
    ) -> None:
        self._members = members
        self._blind = blind
        self.under_way: set[int] = set()  # whose samples are to be followed one by one
        self._of = {
            number: PartialStrokes(
                entities,
                actions,
                keeping.detector(number),
                member.strokes,
                partial(blind, number),
                partial(self._judged, number),
                place=member.namespace,
                tag=member.actuator,
                changed=partial(self._changed, number),
            )
            for number, member in enumerate(members.all)
            if member.strokes.allowed
        }

    def follow(self, number: int, estimate: Estimate) -> None:
        """
        Watch the stem of a valve, as the detector of one valve does.

        :param number: of the valve.
        :param estimate: of its newest sample.
        """
        if number in self.under_way:
            self._of[number].follow(estimate, self._members.all[number].actuator)

    def look(self) -> None:
        """End the strokes of valves that are not seen any more."""
        for number in [number for number in self.under_way if self._blind(number)]:
            self._of[number].end('the valve is not seen any more')

    def _judged(self, number: int) -> bool:
        bank, place = self._members.at(number)
        return bool(bank.decisions[place]['stamp'])

    def _changed(self, number: int, going: bool) -> None:
        (self.under_way.add if going else self.under_way.discard)(number)
