# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Partial strokes of the valves of a fleet that allow them, each served in its own namespace."""

from collections.abc import Callable
from functools import partial

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.nodes.fleet.keeping import Operated
from damadics_fd.nodes.partial_strokes import PartialStrokes


class FleetStrokes:
    """
    Serve `partial_stroke` and publish `stroke_request` for each valve that allows it.

    :param operated: the valves, their detectors, and the record of what people do.
    :param blind: tells of the number of a valve whether its judgement says nothing about now.
    """

    def __init__(self, operated: Operated, blind: Callable[[int], bool]) -> None:
        entities, actions, members, keeping = operated
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

    @property
    def values(self) -> dict[str, str]:
        """Values for the diagnostics: the valves that make strokes, where there are any."""
        names = [self._members.all[number].namespace for number in sorted(self.under_way)]
        return {'Partial strokes under way': ', '.join(names)} if names else {}

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
