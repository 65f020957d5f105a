# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The SCADA-rate monitor as a detector of a campaign, and its residuals with plain tests."""

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.scada.isolation import Isolation, Isolator
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.evaluate.baselines.base import Detector, Floats


class Scada(Detector):
    """The monitor of `core.scada`; its limits follow from theory, not from nominal days."""

    name, title = 'scada', 'SCADA-rate monitor'
    calibrated = False

    def __init__(self, settings: ScadaSettings | None = None) -> None:
        self._settings = settings or ScadaSettings()
        self.monitor = ScadaMonitor(self._settings)

    def fit(self, hour: Floats) -> None:
        """Learn the reference."""
        self.monitor = ScadaMonitor(self._settings, learn(hour, self._settings))

    def trace(self, samples: Floats) -> NDArray:
        """Return the monitor's trace over a run that starts at rest."""
        self.monitor.reset()
        return self.monitor.run_samples(samples)

    def statistic(self, samples: Floats) -> Floats:
        """Return the largest statistic over its limit."""
        return np.asarray(self.trace(samples)['ratio'])

    def isolate(self) -> Isolation | None:
        """Return the ranking of faults after the last run, None without an alarm."""
        monitor = self.monitor
        assert monitor.reference is not None, 'fit first'
        return Isolator(self._settings.record()[0], monitor.reference[0]).isolate(monitor.state)

    def settings(self) -> dict[str, Any]:
        """Return the settings of the monitor."""
        return asdict(self._settings)


class ModelThreshold(Scada):
    """Fixed threshold on the monitor's stem residual: what the model alone brings."""

    name, title = 'fixed_r1', 'fixed threshold on the model residual r1'
    calibrated = True
    column = 'r1'

    def statistic(self, samples: Floats) -> Floats:
        """Return |r|, 0 before the tests are on."""
        return np.where(self.active(samples), np.abs(self.trace(samples)[self.column]), 0.0)


class FlowThreshold(ModelThreshold):
    """Fixed threshold on the monitor's flow residual."""

    name, title = 'fixed_r2', 'fixed threshold on the flow residual r2'
    column = 'r2'
