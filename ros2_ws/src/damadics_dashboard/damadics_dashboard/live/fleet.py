# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Valves that one process judges and reports together, in `fleet/status` once a second."""

import math
from collections.abc import Callable

from damadics_fd.core.stamps import SECOND as NANO
from damadics_fd.core.text import NAME, plain
from damadics_msgs.msg import FaultFlag, FleetEvent, FleetLayout, FleetStatus

from damadics_dashboard.live.valve import Valve

Meet = Callable[[str], Valve]


class FleetReport:
    """
    What one process says of its valves.

    :param meet: returns the valve of a name, which is made where it is new.
    """

    def __init__(self, meet: Meet) -> None:
        self._meet = meet
        self._version = -1
        self._valves: list[Valve] = []

    def take_layout(self, message: FleetLayout) -> None:
        """
        Take the list of valves that indices stand for.

        :param message: the layout.
        """
        self._version = message.version
        self._valves = []
        for name, tag, area in zip(message.valve, message.actuator, message.area, strict=False):
            valve = self._meet(name.strip('/'))
            valve.tag = plain(tag, NAME)
            valve.area = plain(area, NAME)
            self._valves.append(valve)

    def take_status(self, message: FleetStatus, now: float) -> None:
        """
        Take the judgement of the valves that are reported.

        :param message: the status; one of another layout than the last one is left out.
        :param now: monotonic time [s].
        """
        if message.layout != self._version:
            return
        made = message.header.stamp.sec * NANO + message.header.stamp.nanosec
        columns = (
            message.valve, message.state, message.level, message.fault, message.residual,
            message.threshold, message.ratio, message.age, message.progress, message.since,
        )  # fmt: skip
        for n, state, level, fault, residual, threshold, ratio, age, progress, since in zip(
            *columns, strict=False
        ):
            if n >= len(self._valves):
                continue
            flag = FaultFlag(state=int(state), level=int(level), fault=bool(fault))
            flag.residual, flag.threshold = float(residual), float(threshold)
            judged = made - int(age * NANO) if math.isfinite(age) else made
            for field, stamp in ((flag.header.stamp, judged), (flag.since, int(since))):
                field.sec, field.nanosec = divmod(max(stamp, 0), NANO)
            valve = self._valves[int(n)]
            flag.onset = flag.since
            flag.header.frame_id = valve.tag
            flag.occurrence = valve.occurrence
            valve.learned = float(progress)
            valve.take_flag(flag, now)
            if math.isfinite(ratio):
                valve.peak = max(valve.peak, float(ratio))

    def take_event(self, message: FleetEvent, note: Callable[[str, object], None]) -> None:
        """
        Take a transition of the alarm of one valve.

        :param message: the event with its valve.
        :param note: takes the valve's name and the event.
        """
        note(message.valve.strip('/'), message.event)
