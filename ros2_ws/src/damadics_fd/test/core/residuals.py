# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A detector fed with residuals, for the tests of the alarm."""

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.modes import PHASE_MONITOR
from damadics_fd.core.settings import Settings

TICK = 5_000_000


class Valve:
    """A detector fed with residuals as multiples of the threshold."""

    def __init__(self, **changes):
        self.settings = Settings.for_mode('monitor', **changes)
        self.detector = Detector(self.settings)
        self.stamp = 0
        self.events = []

    def feed(self, ratio, seconds=0.0, phase=PHASE_MONITOR, x=0.5, stroke=0.02):
        for _ in range(max(1, round(seconds * 1e9 / TICK))):
            self.stamp += TICK
            xi2 = ratio * self.settings.rho_min
            moved = x + stroke * (self.stamp // 1_000_000_000 % 2)
            decision = self.detector.update(
                Estimate(
                    self.stamp,
                    0.0,
                    x + 0.25,
                    0.0,
                    0.0,
                    xi2,
                    0.0,
                    750.0,
                    30446.0,
                    30446.0,
                    moved,
                    0.5,
                    2e5,
                    9e5,
                    1.0,
                    phase,
                )
            )
            self.events += decision.events
        return decision

    def names(self):
        return [event.name for event in self.events]
