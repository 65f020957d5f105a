# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Valves that one process judges and reports together, in `fleet/status` once a second."""

import math
import time
from collections.abc import Callable

import numpy as np
from damadics_fd.core.stamps import SECOND as NANO
from damadics_fd.core.text import NAME, plain
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultEvent, FleetEvent, FleetLayout, FleetStatus, OperatorAction
from damadics_msgs.srv import (
    FleetAcknowledge,
    FleetReference,
    FleetRelearn,
    FleetReset,
    FleetShelve,
)
from rclpy.node import Node

from damadics_dashboard.live.calls import Field, Service
from damadics_dashboard.live.judged import Judged
from damadics_dashboard.live.valve import Membership, Valve

Meet = Callable[[str], Valve]
UNDER_WAY = 'Partial strokes under way'  # in the diagnostics: the valves
MOST_LAYOUTS = 100  # that are told apart: anybody may send one
OLDEST = 4e9  # s; a greater age counts as this one: anybody may send one
SERVICES: dict[str, tuple[str, Service, dict[str, Field]]] = {  # of one valve: those of a fleet
    'acknowledge': ('acknowledge', FleetAcknowledge, {}),
    'reset': ('reset', FleetReset, {}),
    'shelve': ('shelve', FleetShelve, {}),
    'relearn': ('relearn', FleetRelearn, {}),
    'save_reference': ('reference', FleetReference, {'save': True}),
    'load_reference': ('reference', FleetReference, {'save': False}),
}


def shared(member: Membership, service: str) -> tuple[str, Service, dict[str, Field]]:
    """
    Return what a fleet serves instead of a service of one valve.

    :param member: the valve in its fleet.
    :param service: of one valve.
    :return: name of the service, its type, the fields that name the valve.
    """
    name, kind, fields = SERVICES[service]
    return f'{member.topic}/{name}', kind, {**fields, 'valves': [member.name]}


class FleetReport:
    """
    What one process says of its valves.

    :param meet: returns the valve of a name, which is made where it is new.
    :param topic: of the fleet, such as `/fleet`.
    :param known: returns the valve of a name, None where there is none.
    """

    def __init__(
        self, meet: Meet, topic: str, known: Callable[[str], Valve | None] = lambda name: None
    ) -> None:
        self._meet = meet
        self._known = known
        self._stroking: set[str] = set()  # valves that make partial strokes
        self._topic = topic
        self._layouts: dict[int, list[Valve]] = {}  # a gateway has one of its own

    def subscribe(
        self,
        node: Node,
        note_event: Callable[[str, FaultEvent], None],
        note_action: Callable[[str, OperatorAction], None],
    ) -> None:
        """
        Take the topics of the fleet.

        :param node: of the page.
        :param note_event: takes the name of a valve and a transition of its alarm.
        :param note_action: takes the name of a valve and what a person did to it.
        """
        own = self._topic.rpartition('/')[0]  # namespace of the process
        listen = node.create_subscription
        listen(FleetLayout, f'{self._topic}/layout', self.take_layout, qos.FLAG)
        listen(
            FleetStatus,
            f'{self._topic}/status',
            lambda message: self.take_status(message, time.monotonic()),
            qos.FLAG,
        )
        listen(
            FleetEvent,
            f'{self._topic}/fault_event',
            lambda message: self.take_event(message, note_event),
            qos.EVENTS,
        )
        listen(
            OperatorAction,
            f'{own}/operator_action',
            lambda message: self.take_action(message, note_action),
            qos.EVENTS,
        )

    def take_layout(self, message: FleetLayout) -> None:
        """
        Take the list of valves that indices stand for.

        :param message: the layout.
        """
        valves: list[Valve] = []
        self._layouts[message.version] = valves
        while len(self._layouts) > MOST_LAYOUTS:
            del self._layouts[next(iter(self._layouts))]
        for name, tag, area in zip(message.valve, message.actuator, message.area, strict=False):
            valve = self._meet(name.strip('/'))
            valve.tag = plain(tag, NAME)
            valve.area = plain(area, NAME)
            valve.fleet = Membership(self._topic, name)
            valves.append(valve)

    def take_status(self, message: FleetStatus, now: float) -> None:
        """
        Take the judgement of the valves that are reported.

        :param message: the status; one of a layout that is not known is left out.
        :param now: monotonic time [s].
        """
        valves = self._layouts.get(message.layout)
        if valves is None:
            return
        made = message.header.stamp.sec * NANO + message.header.stamp.nanosec
        age = np.asarray(message.age)
        known = np.isfinite(age)
        old = np.where(known, np.clip(age, -OLDEST, OLDEST), 0.0)
        judged = made - (NANO * old).astype(np.int64)
        columns = (
            message.valve.tolist(),
            message.state.tolist(),
            message.level.tolist(),
            message.fault,
            message.residual.tolist(),
            message.threshold.tolist(),
            np.maximum(judged, 0).tolist(),
            np.maximum(np.asarray(message.since), 0).tolist(),
            message.ratio.tolist(),
            message.progress.tolist(),
            message.cause,
        )
        count = len(valves)
        for n, state, level, fault, residual, limit, stamp, since, ratio, progress, cause in zip(
            *columns, strict=False
        ):
            if n >= count:
                continue
            valve = valves[n]
            valve.learned, valve.suspected = progress, cause
            valve.take(
                Judged(state, level, fault, residual, limit, stamp, since, valve.occurrence), now
            )
            if valve.peak < ratio < math.inf:
                valve.peak = ratio

    def take_event(self, message: FleetEvent, note: Callable[[str, FaultEvent], None]) -> None:
        """
        Take a transition of the alarm of one valve.

        :param message: the event with its valve.
        :param note: takes the valve's name and the event.
        """
        note(message.valve.strip('/'), message.event)

    def take_action(
        self, message: OperatorAction, note: Callable[[str, OperatorAction], None]
    ) -> None:
        """
        Take what a person did to one valve: its name stands before the result.

        :param message: the action.
        :param note: takes the valve's name and the action.
        """
        name, colon, result = message.result.partition(': ')
        if colon and self._member(name):
            message.result = result
            note(name.strip('/'), message)

    def take_diagnostics(self, values: dict[str, str]) -> None:
        """
        Take what the process says of itself: which valves make partial strokes.

        :param values: by their keys.
        """
        told = {name for name in values.get(UNDER_WAY, '').split(', ') if name}
        for name in told ^ self._stroking:
            if valve := self._member(name):
                valve.stroking = name in told
        self._stroking = told

    def _member(self, name: str) -> Valve | None:
        valve = self._known(name.strip('/'))
        return valve if valve and valve.fleet == Membership(self._topic, name) else None
