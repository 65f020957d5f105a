# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The SCADA-rate monitor as a detector of a campaign, and its residuals with plain tests."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
from damadics_fd.core import scada
from damadics_fd.core.scada.judging.cusum import TEST_NAMES
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.naming.isolation import Isolation
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import HISTORY_LENGTH

from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import P1, P2, T1, Detector, Diagnosis, Setting

SIGNATURE = ('m1', 'g1', 'd1', 'rms1', 'm2', 'g2', 'rms2', 'dP1', 'dP2', 'dT1')
SIGNATURE_S = 600


def _regress(values: Floats, *regressors: Floats) -> Floats:
    design = np.column_stack([np.ones(len(values)), *regressors])
    return np.asarray(np.linalg.lstsq(design, values, rcond=None)[0])


class Scada(Detector):
    """The monitor of `core.scada`; its limits follow from theory, not from nominal days."""

    name, title = 'scada', 'SCADA-rate monitor'
    calibrated = False

    def __init__(self, settings: ScadaSettings | None = None) -> None:
        self._settings = settings or ScadaSettings(learn_s=3600.0)
        self.monitor = ScadaMonitor(self._settings)

    def fit(self, hour: Floats) -> None:
        """Learn the reference."""
        self._hour = hour
        self.monitor = ScadaMonitor(self._settings, learn(hour, self._settings))
        rows = self.learning_rows(hour)
        inputs = (('p1', P1), ('p2', P2), ('t1', T1))
        self._mean = {name: float(np.nanmean(rows[:, column])) for name, column in inputs}

    def trace(self, samples: Floats) -> np.ndarray:
        """Return the monitor's trace over a run that starts at rest."""
        self.monitor.reset()
        trace = self.monitor.run_samples(samples)
        _last[:] = [(self._hour, samples, trace)]
        return trace

    def statistic(self, samples: Floats) -> Floats:
        """Return the largest statistic over its limit."""
        return np.asarray(self.trace(samples)['ratio'])

    def first_test(self) -> str | None:
        """Return the test that raised the alarm of the last run."""
        state = self.monitor.state
        return TEST_NAMES[int(state.test)] if state.alarm else None

    def signature(self) -> dict[str, float]:
        """
        Return how the residuals and inputs of the last 600 s differ from the learned ones.

        :return: m1, g1, d1, rms1 of r1 (mean, gain with the model's position, share of the
            stroke's direction), m2, g2, rms2 of F' - f, and the shifts of P1', P2', T1'.
        """
        state = self.monitor.state
        kept = min(int(state.samples), SIGNATURE_S)
        last = np.arange(state.samples - kept, state.samples) % HISTORY_LENGTH
        rows = np.asarray(state.history)[last]
        direction = np.sign(rows['cv'] - rows['cv0'])
        position = (rows['xm'] - 0.5) / 0.18
        m1, g1, d1 = _regress(rows['r1'], position, direction)
        flow = np.nan_to_num(rows['flow'] - rows['f'])
        m2, g2 = _regress(flow, np.nan_to_num(rows['f'] - 0.6))
        shift = [np.nanmean(rows[name]) - self._mean[name] for name in ('p1', 'p2', 't1')]
        values = (m1, g1, d1, rows['r1'].std(), m2, g2, flow.std(), *shift)
        return dict(zip(SIGNATURE, (round(float(v), 6) for v in values), strict=True))

    def isolate_at(self, samples: Floats, alarm: float, times: Sequence[float]) -> list[Diagnosis]:
        """Run again and isolate at given times; see `Detector`."""
        self.monitor.reset()
        found: list[Isolation] = []
        done = 0
        for time in times:
            until = int(np.searchsorted(samples[:, 0], time, side='right'))
            self.monitor.run_samples(samples[done:until])
            done = until
            isolation = self.monitor.isolate()
            if isolation is None:
                continue
            if found and isolation.worse_than(found[-1]):
                isolation = replace(found[-1], t=isolation.t)
            found.append(isolation)
        return [_diagnosis(isolation) for isolation in found]

    def settings(self) -> dict[str, Setting]:
        """Return the settings of the monitor and a digest of its source, which holds margins."""
        return {**asdict(self._settings), 'source': _source()}


def _diagnosis(isolation: Isolation) -> Diagnosis:
    best = isolation.best.cost
    return Diagnosis(
        isolation.t,
        tuple((h.fault, float(h.strength), float(h.cost - best)) for h in isolation.ranking),
        tuple(isolation.candidates),
        isolation.group,
    )


@cache
def _source() -> str:
    digest = hashlib.sha256()
    for file in sorted(Path(scada.__path__[0]).rglob('*.py')):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


class ModelThreshold(Detector):
    """Fixed threshold on the monitor's stem residual: what the model alone brings."""

    name, title = 'fixed_r1', 'fixed threshold on the model residual r1'
    column = 'r1'

    def fit(self, hour: Floats) -> None:
        """Keep the record; the monitor learns from it."""
        self._hour = hour

    def statistic(self, samples: Floats) -> Floats:
        """Return |r|, 0 before the tests are on."""
        trace = _shared_trace(self._hour, samples)
        return np.where(self.active(samples), np.abs(trace[self.column]), 0.0)

    def settings(self) -> dict[str, Setting]:
        """Return a digest of the monitor whose residual it judges."""
        return {**super().settings(), 'source': _source()}


class FlowThreshold(ModelThreshold):
    """Fixed threshold on the monitor's flow residual."""

    name, title = 'fixed_r2', 'fixed threshold on the flow residual r2'
    column = 'r2'


_last: list[tuple[Floats, Floats, np.ndarray]] = []  # hour, samples, trace of the last run


def _shared_trace(hour: Floats, samples: Floats) -> np.ndarray:
    """Return the monitor's trace; two detectors in a row on the same run share it."""
    if not _last or _last[0][0] is not hour or _last[0][1] is not samples:
        detector = Scada()
        detector.fit(hour)
        _last[:] = [(hour, samples, detector.trace(samples))]
    return _last[0][2]
