# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a fleet tells of its valves: events and causes of all, all topics of exposed ones."""

import time
from collections.abc import Callable

import numpy as np
from damadics_msgs.msg import FaultFlag, FleetEvent, FleetIsolation, Isolation
from numpy.typing import NDArray
from rclpy.node import Node

from damadics_fd.causes import CauseTable
from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.events import Decision, Event
from damadics_fd.core.judgement import Judgement, LiveJudgement
from damadics_fd.core.record import Floats
from damadics_fd.nodes.fleet.ages import Ages
from damadics_fd.nodes.fleet.blocks import Rows
from damadics_fd.nodes.fleet.exposed import Exposed
from damadics_fd.nodes.fleet.keeping import Keeping
from damadics_fd.nodes.fleet.members import Happening, Members, Taken
from damadics_fd.nodes.fleet.strokes import FleetStrokes
from damadics_fd.ros import qos
from damadics_fd.ros.conversions import hide, judgement_message, write_flag
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.explained import explained_messages


class Telling:
    """
    Publish events, causes, and the topics of exposed valves.

    :param node: the fleet's node.
    :param entities: of the node.
    :param members: the valves.
    :param keeping: their alarms.
    :param ages: of their samples.
    :param causes: texts and advice.
    :param strokes: partial strokes, for which samples are followed one by one.
    """

    def __init__(
        self,
        node: Node,
        entities: Entities,
        members: Members,
        keeping: Keeping,
        ages: Ages,
        causes: CauseTable,
        strokes: FleetStrokes,
    ) -> None:
        self._node = node
        self._entities = entities
        self._members = members
        self._keeping = keeping
        self._ages = ages
        self._causes = causes
        self._strokes = strokes
        self._event = entities.publisher(FleetEvent, 'fleet/fault_event', qos.EVENTS)
        self._isolation = entities.publisher(FleetIsolation, 'fleet/isolation', qos.EVENTS)
        self._exposed: dict[int, Exposed] = {}
        self._watched: set[int] = set()
        self._judgements: dict[int, Judgement] = {}  # the latest of mode scada, by valve
        self._live: dict[int, LiveJudgement] = {}  # of valves in mode scada that had an alarm

    def expose(self, count: int, take: Callable[[int, bytes], None]) -> None:
        """
        Give valves topics of their own.

        :param count: how many, from the first.
        :param take: called with the number of a valve and its serialised measurement.
        """
        for number, member in enumerate(self._members.all[:count]):
            self._exposed[number] = Exposed(self._entities, number, member, take)

    def judge(self, rows: Rows) -> Taken:
        """
        Have rows judged; those of valves that are watched one by one, and published.

        :param rows: checked rows.
        :return: what became of them.
        """
        followed = self._watched | self._strokes.under_way
        if not followed:
            return self._members.take(rows)
        watched = np.isin(rows.valve, list(followed))
        if not watched.any():
            return self._members.take(rows)
        parts = [self._members.take(_some(rows, ~watched))] if not watched.all() else []
        for row in np.flatnonzero(watched):
            taken = self._members.take(_some(rows, np.arange(len(watched)) == row))
            parts.append(taken)
            if not taken.refused:
                number = int(rows.valve[row])
                bank, place = self._members.at(number)
                decision = Decision(*bank.decisions[place].item())
                estimate = Estimate(*bank.estimates[place].item())
                if number in self._watched:
                    self._exposed[number].sample(estimate, decision)
                self._strokes.follow(number, estimate)
        return Taken(
            [one for part in parts for one in part.happened],
            sum(part.refused for part in parts),
            set().union(*(part.changed for part in parts)),
        )

    def tell(self, happened: list[Happening], remark: str = '') -> None:
        """
        Tell transitions of alarms, and keep them.

        :param happened: the transitions.
        :param remark: who caused them and why.
        """
        for number, event in happened:
            if self._members.all[number].settings.mode != 'scada':
                self._tell_event(number, event, remark)
                continue
            for one in self._live_of(number).tell((event,), self._news_of(number)):
                self._tell_event(number, one, remark)
        for number in {number for number, _ in happened}:
            self._keeping.keep(number)
            self.flag(number)

    def _tell_event(self, number: int, event: Event, remark: str = '') -> None:
        member = self._members.all[number]
        tag, place = member.actuator, member.namespace
        own = bool(self._keeping.detector(number).signature.state[0].own)
        message, isolation = explained_messages(event, self._causes, tag, tag, own, remark)
        self._event.publish(FleetEvent(valve=place, event=message))
        if isolation and member.settings.mode != 'scada':
            self._tell_cause(number, isolation)
        if number in self._exposed:
            self._exposed[number].event.publish(message)

    def flag(self, number: int) -> None:
        """
        Publish the flag of a valve, if it is exposed.

        :param number: of the valve.
        """
        if number in self._exposed:
            self._flag(number, self.ages()[number])

    def beat(self, ages: Floats) -> None:
        """
        Publish the flags of all exposed valves, and see who listens to them.

        :param ages: of all valves.
        """
        self._watched = {n for n, one in self._exposed.items() if one.watched}
        self._look_at_faults()
        for number in self._exposed:
            self._flag(number, ages[number])

    def _look_at_faults(self) -> None:
        """Tell what faults are taken for in mode scada, where that has changed."""
        for bank, numbers in zip(self._members.banks, self._members.numbers, strict=True):
            if bank.mode != 'scada':
                continue
            for place in np.flatnonzero(bank.decisions['fault']).tolist():
                number = int(numbers[place])
                judgement = self._news_of(number)
                if judgement is None:
                    continue
                for event in self._live_of(number).tell((), judgement):
                    self._tell_event(number, event)
                self._keeping.keep(number)

    def _live_of(self, number: int) -> LiveJudgement:
        if number not in self._live:
            self._live[number] = LiveJudgement(self._keeping.detector(number))
        return self._live[number]

    def _news_of(self, number: int) -> Judgement | None:
        """Return what the fault of a valve is taken for, and tell it, where that has changed."""
        bank, place = self._members.at(number)
        judgement = bank.judgement(place)
        if judgement is None or judgement is self._judgements.get(number):
            return None
        self._judgements[number] = judgement
        self._tell_cause(number, judgement_message(judgement, self._members.all[number].actuator))
        return judgement

    def _tell_cause(self, number: int, isolation: Isolation) -> None:
        place = self._members.all[number].namespace
        self._isolation.publish(FleetIsolation(valve=place, isolation=isolation))
        if number in self._exposed:
            self._exposed[number].isolation.publish(isolation)

    def ages(self) -> Floats:
        """
        Return the ages of the newest samples of all valves.

        :return: [s], NaN before the first.
        """
        return self._ages.ages(self._node.get_clock().now().nanoseconds, time.monotonic())

    def _flag(self, number: int, age: float) -> None:
        bank, place = self._members.at(number)
        flag = FaultFlag()
        flag.header.frame_id = self._members.all[number].actuator
        write_flag(Decision(*bank.decisions[place].item()), flag)
        if not age <= self._ages.limits[number]:
            hide(flag)
        self._exposed[number].flag.publish(flag)


def _some(rows: Rows, which: NDArray[np.bool_]) -> Rows:
    signals = {name: column[which] for name, column in rows.signals.items()}
    return Rows(rows.valve[which], rows.stamp[which], signals)
