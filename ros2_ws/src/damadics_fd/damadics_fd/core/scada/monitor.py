# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The SCADA-rate monitor: learn from a fault-free hour, then watch, one sample or a column."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.scada.judging.cusum import R1, R2, TEST_NAMES, TESTS
from damadics_fd.core.scada.judging.predict import STRANGE, stands_still
from damadics_fd.core.scada.judging.residuals import FLOW_TOLD, STEM_TOLD
from damadics_fd.core.scada.judging.roughness import rougher
from damadics_fd.core.scada.laws.actuator import F_RANGE, P_RANGE, T_RANGE, TPH_PER_KGS
from damadics_fd.core.scada.learning import LearningError, learn
from damadics_fd.core.scada.loops import TRACE, bring_up, collect, run_column
from damadics_fd.core.scada.naming.isolation import Isolation, Isolator
from damadics_fd.core.scada.samples import scada_samples
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import HISTORY_LENGTH, MONITOR, REFERENCE, MonitorState

Floats = NDArray[np.float64]
KEPT = ('alarm', 't_alarm', 't_onset', 'test', 'occurrence', 'stood', 'recovery', 'stands')
FLOW_TEST = [test.residual for test in TESTS].index(R2) + 1
LEARN_AGAIN_S = 60.0
AIR_TOLD = 0.05
ROUGH = 1.3  # noise that has grown by this factor is told


@dataclass(frozen=True)
class ScadaDecision:
    """
    What the monitor says after one sample.

    :param t: time of the sample, s.
    :param monitoring: false while it learns or settles; no decision then.
    :param r1: stem residual, share of stroke.
    :param r2: flow residual, sigma.
    :param ratio: largest test statistic over its limit; 1 raises the alarm.
    :param test: name of that test.
    :param alarm: latched alarm.
    """

    t: float
    monitoring: bool
    r1: float
    r2: float
    ratio: float
    test: str
    alarm: bool


class ScadaMonitor:
    """
    Watch one valve at 1 Hz.

    Without a reference it first learns from its own start (`learn_s`); the record must be
    fault-free.

    :param settings: what the user states.
    :param reference: structured array of `REFERENCE` from `learn`; learned on line where absent.
    """

    def __init__(
        self, settings: ScadaSettings | None = None, reference: np.ndarray | None = None
    ) -> None:
        self.settings = settings or ScadaSettings()
        self._record = self.settings.record()
        self._given = reference
        if reference is not None and reference.dtype != REFERENCE:
            raise ValueError('the reference has another layout: learn it again with this version')
        self.reset()

    def reset(self) -> None:
        """Forget every sample, and the reference unless it was given."""
        self.reference = self._given
        self.learning_problem = ''
        self.notes: list[str] = []
        self._isolated: tuple[tuple[int, int], Isolation | None] | None = None
        self._state = np.zeros(1, MONITOR)
        self._buffer = np.empty((0, 7))
        self._filled = 0
        self._learn_until = self.settings.learn_s
        self._trace = np.zeros(1, TRACE)

    def forget(self) -> None:
        """Forget every sample and any reference: learn from the next sample on."""
        self._given = None
        self.reset()

    def resume(self) -> None:
        """Start the models afresh at the next sample, for a clock that was set; keep the alarm."""
        if self.reference is None:
            self.reset()
            return
        before, self._state = self._state, np.zeros(1, MONITOR)
        for name in KEPT:
            self._state[name] = before[name]

    @property
    def _last_learned(self) -> float:
        """Return the time of the last sample of the learning record since the first one, s."""
        return self._learn_until - self.settings.period_s

    @property
    def progress(self) -> float:
        """Return the share of the learning that is done, 0..1."""
        if self.reference is not None:
            return 1.0
        return min(float(self.state.t - self.state.t_first) / self._learn_until, 1.0)

    def hold(self, states: np.ndarray, reference: np.ndarray) -> None:
        """Go on with a state and a reference that are kept elsewhere, arrays of length 1."""
        self._state, self._given, self.reference = states, reference, reference

    def seen_bytes(self) -> bytes:
        """Return what was seen of a valve that is still learned, to be taken up elsewhere."""
        until = np.float64(self._learn_until).tobytes()
        return self._state.tobytes() + until + self._buffer[: self._filled].tobytes()

    def restore_seen(self, seen: bytes) -> None:
        """Go on learning with what `seen_bytes` returned; ValueError where it is not that."""
        size = MONITOR.itemsize
        rows, rest = divmod(len(seen) - size - 8, 7 * 8)
        if rows < 0 or rest:
            raise ValueError('what was seen of the valve is damaged: learn it anew')
        self._state = np.zeros(1, MONITOR)  # a copy of the record would leave its padding out
        self._state.view(np.uint8)[:] = np.frombuffer(seen, np.uint8, size)
        self._learn_until = float(np.frombuffer(seen, np.float64, 1, size)[0])
        self._buffer = np.frombuffer(seen, np.float64, 7 * rows, size + 8).reshape(rows, 7).copy()
        self._filled = rows

    @property
    def states(self) -> np.ndarray:
        """Return the array of length 1 that holds the record of the compiled step."""
        return self._state

    @property
    def record(self) -> np.ndarray:
        """Return the settings of the compiled step."""
        return self._record

    @property
    def state(self) -> MonitorState:
        """Return the record of the compiled step."""
        state: MonitorState = self._state[0]
        return state

    def update(
        self,
        t: float,
        cv: float,
        x1: float,
        p1: float,
        p2: float,
        t1: float = math.nan,
        flow: float = math.nan,
    ) -> ScadaDecision | None:
        """
        Take one measurement.

        :param t: time of its stamp, s.
        :param cv: command, 0..1; x1 the position, 0..1.
        :param p1: inlet pressure, Pa; p2 the outlet's.
        :param t1: temperature, degC; flow in kg/s; NaN where not measured.
        :return: the decision, or None where the sample was refused or thinned out.
        """
        row = np.array(
            [[t, cv, x1, p1 / P_RANGE, p2 / P_RANGE, t1 / T_RANGE, flow * (TPH_PER_KGS / F_RANGE)]]
        )
        trace = self.run_samples(row)
        if not len(trace):
            return None
        last = trace[0]
        return ScadaDecision(
            t=float(last['t']),
            monitoring=self.reference is not None and bool(last['t'] >= self.state.t_test),
            r1=float(last['r1']),
            r2=float(last['r2']),
            ratio=float(last['ratio']),
            test=TEST_NAMES[int(last['worst'])],
            alarm=bool(last['alarm']),
        )

    def run(self, columns: Mapping[str, np.ndarray]) -> np.ndarray:
        """
        Take a recording; the same result bit for bit as sample by sample.

        :param columns: as `scada_samples` takes them.
        :return: structured array of `TRACE`, one row per accepted sample.
        """
        return self.run_samples(scada_samples(columns))

    def run_samples(self, samples: Floats) -> np.ndarray:
        """
        Take rows as `scada_samples` returns them.

        :param samples: shape (n, 7).
        :return: structured array of `TRACE`, one row per accepted sample.
        """
        learned = np.zeros(0, TRACE)
        start = 0
        while self.reference is None and start < len(samples):
            start, learned = self._learn_from(samples, start, learned)
        trace = np.zeros(len(samples) - start, TRACE)
        count = 0
        if self.reference is not None:
            count = run_column(self._state, self._record, self.reference, samples[start:], trace)
        return np.concatenate((learned, trace[:count])) if len(learned) else trace[:count]

    def isolate(self) -> Isolation | None:
        """
        Rank the faults that explain the record since the onset; None without an alarm.

        The ranking is kept until there is more evidence, or a sixteenth more samples.
        """
        if self.reference is None or not self.state.alarm:
            return None
        since = self.state.t_evidence - self.state.t_onset
        key = (int(self.state.occurrence), int(16.0 * math.log2(max(since, 1.0))))
        if self._isolated is None or self._isolated[0] != key:
            isolator = Isolator(self._record[0], self.reference[0])
            self._isolated = (key, isolator.isolate(self.state))
        return self._isolated[1]

    @property
    def strange(self) -> str:
        """Say that samples come at another period than the learned one; '' where they do not."""
        state = self.state
        if self.reference is None or state.strange < STRANGE:
            return ''
        n = int(state.samples)
        ago = state.history[(n - 2) % HISTORY_LENGTH].t
        period = float(self.reference['period'][0])
        return (
            f'samples come every {float(state.t - ago):.3g} s, but every {period:.3g} s were '
            'learned from: learn anew'
        )

    def drifts(self) -> list[str]:
        """Return what has drifted so far that a person should know, and noise that grew."""
        if self.reference is None:
            return []
        stem, flow = (float(v) for v in self.state.drift)
        told = []
        if abs(stem) > STEM_TOLD:
            told.append(f'the stem has drifted by {100.0 * stem:+.1f} % of the stroke')
        if abs(flow) > FLOW_TOLD:
            told.append(f'the flow has drifted by {100.0 * math.expm1(flow):+.0f} %')
        slower = math.expm1(float(self.state.air))
        if abs(slower) > AIR_TOLD:
            word = 'slower' if slower > 0.0 else 'quicker'
            told.append(f'the air path is {100.0 * abs(slower):.0f} % {word} than learned')
        for name, r in (('stem', R1), ('flow', R2)):
            factor = float(rougher(self.state, self.reference[0], r, 1))
            if factor > ROUGH:
                told.append(f'the {name} is {factor:.1f} times as noisy as learned')
        return told

    def missing(self) -> list[str]:
        """Return the tests that cannot be made, each with the reason."""
        if self.reference is None:
            return []
        ref = self.reference[0]
        off = []
        if stands_still(self.state, ref):
            off.append('stem and flow (all signals stand still)')
        if not ref['sd'][FLOW_TEST] > 0.0:
            off.append('the flow (P1, P2, T1 or F is not measured, or too few samples)')
        if not ref['drop'] > 0.0:
            off.append('the pressures (not measured)')
        return off

    def _learn_from(
        self, samples: Floats, start: int, learned: np.ndarray
    ) -> tuple[int, np.ndarray]:
        room = self._filled + len(samples) - start
        if room > len(self._buffer):
            larger = np.empty((max(room, 2 * len(self._buffer), 4096), 7))
            larger[: self._filled] = self._buffer[: self._filled]
            self._buffer = larger
        before = self._filled
        start, self._filled = collect(
            self._state, self._record, samples, start, self._buffer, before, self._last_learned
        )
        quiet = np.zeros(self._filled - before, TRACE)
        quiet['t'] = self._buffer[before : self._filled, 0]
        quiet['r1'] = quiet['r2'] = np.nan
        if self._filled and self.state.t - self.state.t_first >= self._last_learned:
            self._arm()
        return start, np.concatenate((learned, quiet))

    def _arm(self) -> None:
        """Learn from the buffer, then bring the models to the present through it."""
        record = self._buffer[: self._filled]
        try:
            reference = learn(record, self.settings, self._learn_until, self.notes)
        except LearningError as problem:
            self.learning_problem = str(problem)
            self._learn_until += LEARN_AGAIN_S
            return
        self.reference = reference
        self.learning_problem = ''
        self._state = np.zeros(1, MONITOR)
        bring_up(self._state, self._record, reference, record)
        self.state.t_test = max(self.state.t_test, self.state.t)
        self.state.zero[:] = self.state.t
        self.state.stretch[:] = 0.0
        self.state.llr_zero = self.state.t
        self._buffer = np.empty((0, 7))
        self._filled = 0
