# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The SCADA-rate monitor: learn from a fault-free hour, then watch, one sample or a column."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.cusum import R2, TEST_NAMES, TESTS
from damadics_fd.core.scada.judging.predict import predict
from damadics_fd.core.scada.judging.residuals import residuals
from damadics_fd.core.scada.laws.actuator import F_RANGE, P_RANGE, T_RANGE, TPH_PER_KGS
from damadics_fd.core.scada.learning import LearningError, learn
from damadics_fd.core.scada.naming.isolation import Isolation, Isolator
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import MONITOR, REFERENCE, MonitorState
from damadics_fd.core.scada.step import accepts, step

Floats = NDArray[np.float64]
TRACE = np.dtype(
    [
        ('t', np.float64),
        ('r1', np.float64),
        ('r2', np.float64),
        ('ratio', np.float64),
        ('worst', np.int64),
        ('alarm', np.bool_),
    ]
)
FARTHEST = 5.0  # times 4 MPa: no control valve works above
OUTSIDE = 0.25  # share of full scale a measurement may lie outside its range
KEPT = ('alarm', 't_alarm', 't_onset', 'test', 'occurrence', 'stood', 'recovery', 'stands')
FLOW_TEST = [test.residual for test in TESTS].index(R2) + 1
LEARN_AGAIN_S = 60.0


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


def scada_samples(columns: Mapping[str, np.ndarray]) -> Floats:
    """
    Return the columns of a recording as rows t, CV, X', P1', P2', T1', F', scaled to 0..1.

    :param columns: `stamp` (ns) and cv, x1; p1, p2 (Pa), t1 (degC), flow (kg/s) where measured.
    :return: array of shape (n, 7); NaN where not measured.
    """
    n = len(columns['stamp'])
    missing = np.full(n, np.nan)
    return np.column_stack(
        [
            columns['stamp'] / 1e9,
            columns['cv'],
            columns['x1'],
            columns.get('p1', missing) / P_RANGE,
            columns.get('p2', missing) / P_RANGE,
            columns.get('t1', missing) / T_RANGE,
            columns.get('flow', missing) * (TPH_PER_KGS / F_RANGE),
        ]
    ).astype(np.float64)


@jit
def usable(sample: np.ndarray, s: MonitorState) -> bool:
    """Tell whether a sample may enter: in time order, finite, near its ranges."""
    if not math.isfinite(sample[0]) or (s.samples > 0 and sample[0] <= s.t_raw):
        return False
    for i in range(1, 3):
        if not -OUTSIDE <= sample[i] <= 1.0 + OUTSIDE:  # NaN: refused
            return False
    for i in range(3, 5):
        if not math.isnan(sample[i]) and not -OUTSIDE <= sample[i] <= FARTHEST:
            return False
    return not math.isinf(sample[5]) and not math.isinf(sample[6])


@jit
def _run(
    state: np.ndarray,
    settings: np.ndarray,
    reference: np.ndarray,
    samples: np.ndarray,
    trace: np.ndarray,
) -> int:
    s = state[0]
    count = 0
    for i in range(samples.shape[0]):
        row = samples[i]
        if not usable(row, s) or not accepts(s, settings[0], row[0]):
            continue
        step(s, settings[0], reference[0], row[0], row[1], row[2], row[3], row[4], row[5], row[6])
        out = trace[count]
        out.t = s.t
        out.r1 = s.residual[0]
        out.r2 = s.residual[1]
        out.ratio = s.ratio
        out.worst = s.worst
        out.alarm = s.alarm
        count += 1
    return count


@jit
def _collect(
    state: np.ndarray,
    settings: np.ndarray,
    samples: np.ndarray,
    start: int,
    buffer: np.ndarray,
    filled: int,
    until: float,
) -> tuple[int, int]:
    s = state[0]
    i = start
    while i < samples.shape[0] and filled < buffer.shape[0]:
        row = samples[i]
        i += 1
        if not usable(row, s) or not accepts(s, settings[0], row[0]):
            continue
        if s.samples == 0:
            s.t_first = row[0]
        s.samples += 1
        s.t = row[0]
        buffer[filled] = row
        filled += 1
        if row[0] - s.t_first >= until:
            break
    return i, filled


@jit
def _replay(
    state: np.ndarray, settings: np.ndarray, reference: np.ndarray, samples: np.ndarray
) -> None:
    s = state[0]
    for i in range(samples.shape[0]):
        r = samples[i]
        predict(s, settings[0], reference[0], r[0], r[1], r[2], r[3], r[4], r[5], r[6])
        residuals(s, reference[0], r[2], r[3], r[4], r[5], r[6])
        s.t_raw = r[0]


class ScadaMonitor:
    """
    Watch one valve at 1 Hz.

    Without a reference it first learns from its own start (`learn_s`); the record must be
    fault-free. Nothing adapts afterwards.

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
        self._state = np.frombuffer(seen, MONITOR, 1).copy()
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
            count = _run(self._state, self._record, self.reference, samples[start:], trace)
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

    def missing(self) -> list[str]:
        """Return the tests that cannot be made, each with the reason."""
        if self.reference is None:
            return []
        ref = self.reference[0]
        off = []
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
        start, self._filled = _collect(
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
        _replay(self._state, self._record, reference, record)
        self.state.t_test = max(self.state.t_test, self.state.t)
        self.state.zero[:] = self.state.t
        self.state.llr_zero = self.state.t
        self._buffer = np.empty((0, 7))
        self._filled = 0
