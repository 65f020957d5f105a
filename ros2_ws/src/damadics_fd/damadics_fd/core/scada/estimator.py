# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The SCADA-rate monitor in the place of the estimator: same samples, same alarm life."""

import math
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core import quality
from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.intake import Intake
from damadics_fd.core.judgement import Judgement
from damadics_fd.core.modes import PHASE_HOLD, PHASE_INIT, PHASE_LEARN_PHI, PHASE_MONITOR, PHASES
from damadics_fd.core.quality import Refused
from damadics_fd.core.record import Array, Floats, Ints, Plain, Saved
from damadics_fd.core.scada.kernel import Shown, take_column, write
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.naming.looks import Looks
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import MONITOR, Reference
from damadics_fd.core.settings import Settings
from damadics_fd.core.valve.parameters import Valve

BLANK = np.zeros(1, MONITOR)


@lru_cache(256)  # a fleet has thousands of valves with equal settings
def scada_settings(settings: Settings, kv_stated: bool | None = None) -> ScadaSettings:
    """
    Return what the monitor of mode scada reads of all settings.

    :param settings: of mode scada.
    :param kv_stated: the valve coefficient is this valve's; None: where it is no default.
    """
    if kv_stated is None:
        kv_stated = settings.kv != Valve().kv
    return ScadaSettings(
        period_s=1.0 / min(settings.sample_rate, 1.0),
        t_on_s=settings.t_on,
        learn_from_s=settings.t_w,
        learn_s=settings.t_learn,
        gap_s=settings.gap_reset,
        settle_s=settings.hold,
        days_per_false_alarm=settings.false_alarm_days,
        sigma=settings.sensor_noise,
        kv_stated=kv_stated,
        actuator=settings.valve(),
    )


@cache
def _learned_names() -> frozenset[str]:
    return frozenset(Reference.plain(Reference.rows()))


class ScadaEstimator(Intake):
    """
    Estimate the stem at 1 Hz from CV, P1, P2 and judge it by its tests.

    The estimate carries xi1 = r1, the stem residual, and xi2 = largest test statistic over its
    limit, signed as r1: the detector's threshold is then 1.

    :param settings: all settings, of mode `scada`.
    """

    stride = 60

    def __init__(self, settings: Settings) -> None:
        self.monitor = ScadaMonitor(scada_settings(settings))
        super().__init__(settings)
        self.looks = Looks()
        self.shown = Shown.rows()
        self._estimate = Estimate.rows()
        self.reset()

    def hold(self, quality: Array, shown: Array) -> Self:
        """
        Go on with a state that is kept elsewhere, in place.

        :param quality: of the input, an array of length 1 like the following.
        :param shown: what the estimates show.
        :return: this estimator.
        """
        self.quality, self.shown = quality, shown
        return self

    def reset(self) -> None:
        """Forget everything: what was learned, the models and the counters."""
        self.forget()
        self.monitor.forget()
        self.shown[:] = Shown.rows()
        self.shown['phase'] = PHASE_INIT

    def update(
        self,
        stamp: int,
        cv: float,
        x1: float,
        p1: float,
        p2: float,
        t1: float,
        flow: float,
        ps: float,
    ) -> Estimate | Refused:
        """
        Take one measurement; `t1` and `flow` may be NaN, `ps` is not used.

        :param stamp: sampling instant [ns]; the rest are the signals.
        :return: the estimate, or why the sample was refused.
        """
        values = (cv, x1, p1, p2, t1, flow, ps)
        reason = np.empty(1, np.uint8)
        signals = [np.array([value]) for value in values]
        self.run(np.array([stamp]), signals, reason, self._estimate)
        if reason[0] and self.refused:
            return self.refused
        return Estimate(*self._estimate.item())

    def run(
        self,
        stamp: Ints,
        signals: Sequence[Floats],
        reason: NDArray[np.uint8],
        estimates: Array,
    ) -> None:
        """
        Take a column of measurements.

        :param stamp: sampling instants [ns].
        :param signals: contiguous columns in the order of SIGNALS.
        :param reason: written: 0 or the reason of refusal.
        :param estimates: rows of `Estimate`, written; those of refused samples stay as they are.
        """
        before = self.last_stamp
        learned = 0
        while learned < len(stamp) and self.monitor.reference is None:
            values = [float(signal[learned]) for signal in signals]
            row = estimates[learned : learned + 1]
            reason[learned] = self._learn(int(stamp[learned]), values, row)
            learned += 1
        if learned < len(stamp) and self.monitor.reference is not None:
            rest = slice(learned, None)
            take_column(
                self.quality,
                self.shown,
                self.monitor.states,
                self._settings,
                self.monitor.record,
                self.monitor.reference,
                BLANK,
                reason[rest],
                estimates[rest],
                stamp[rest],
                *(signal[rest] for signal in signals),
            )
        self.note_column(reason, stamp, signals, before)

    def _learn(self, stamp: int, values: Sequence[float], row: Array) -> int:
        """Take one sample while the valve is learned; return ACCEPTED or the reason."""
        q, c, shown = self.quality[0], self._settings[0], self.shown[0]
        reason = quality.check_values(c, *values) or quality.check_stamp(q, c, stamp)
        restarted = not q.started
        quality.admit(q, c, stamp, reason)
        if reason:
            return reason
        if restarted:
            self.monitor.resume()  # the first sample, or a clock set back
        cv, x1, p1, p2, t1, flow, ps = values
        decision = self.monitor.update(stamp * 1e-9, cv, x1, p1, p2, t1, flow)
        if decision is not None:
            learning = self.monitor.reference is None
            armed = PHASE_MONITOR if decision.monitoring else PHASE_HOLD
            shown.residual = 0.0 if math.isnan(decision.r1) else decision.r1
            shown.ratio = 0.0 if learning else decision.ratio
            shown.phase = PHASE_LEARN_PHI if learning else armed
        write(row[0], shown, c, stamp, cv, x1, p1, p2, ps, self.monitor.progress)
        return reason

    @property
    def phase(self) -> str:
        """
        Return the phase of the last estimate.

        :return: a name out of `modes.PHASES`.
        """
        return PHASES[int(self.shown['phase'][0])]

    @property
    def monitoring(self) -> bool:
        """
        Tell whether decisions count.

        :return: True in the phase `monitor`.
        """
        return bool(self.shown['phase'][0] == PHASE_MONITOR)

    @property
    def progress(self) -> float:
        """
        Return the share of the learning that is done.

        :return: 0..1.
        """
        return self.monitor.progress

    @property
    def judgement(self) -> Judgement | None:
        """
        Return what the latest fault is taken for; looked at anew as the evidence grows.

        :return: the judgement, None before any alarm.
        """
        return self.looks.judge(self.monitor)

    @property
    def status(self) -> str:
        """
        Say in one line what the monitor does.

        :return: for people; never "monitoring" while it does not monitor.
        """
        phase = self.shown['phase'][0]
        if phase == PHASE_MONITOR:
            isolation = self.monitor.isolate()
            if isolation:
                return f'monitoring; alarm: {isolation.text()}'
            off = self.monitor.missing()
            told = [f'no test of {", ".join(off)}'] if off else []
            return '; '.join(['monitoring', *told, *self.monitor.drifts()])
        if phase == PHASE_HOLD and self.monitor.strange:
            return f'on hold: {self.monitor.strange}'
        if phase == PHASE_HOLD:
            return 'on hold: the models settle'
        if phase == PHASE_INIT:
            return 'waiting for the first good sample'
        share = f'learning, {100.0 * self.monitor.progress:.0f} %'
        problem = self.monitor.learning_problem
        return f'{share}: {problem}' if problem else share

    def learned(self) -> Saved:
        """
        Return what was learned, to be kept over a restart.

        :return: plain numbers and lists by name, fit for JSON.
        :raises ValueError: where learning is not finished.
        """
        reference = self.monitor.reference
        if reference is None:
            raise ValueError(f'nothing to save: {self.status}')
        return Reference.plain(reference)

    def restore(self, learned: Mapping[str, Plain]) -> None:
        """
        Take up what `learned` returned and monitor as soon as the models have settled.

        :param learned: what was learned.
        :raises ValueError: where it is not that; the monitor is then untouched.
        """
        if learned.keys() != _learned_names():
            raise ValueError(
                'learned state: it is damaged or of another version of mode scada: learn anew, '
                'live or by commission --mode scada RECORDING'
            )
        reference = Reference.read(learned, 'learned state')
        if not (reference['s1'] > 0.0).all() or not (reference['llr_limit'] > 0.0).all():
            raise ValueError('learned state: s1 and llr_limit must be positive')
        self.monitor = ScadaMonitor(self.monitor.settings, reference)

    def relearn(self, after_repair: bool = False) -> None:
        """
        Learn anew from the next sample on.

        :param after_repair: makes no difference here.
        """
        self.monitor.forget()
        self.shown['phase'] = PHASE_LEARN_PHI
