# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The SCADA-rate monitor in the place of the estimator: same samples, same alarm life."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from damadics_fd.core import quality
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.approximator.step import Estimate
from damadics_fd.core.modes import PHASE_HOLD, PHASE_INIT, PHASE_LEARN_PHI, PHASE_MONITOR
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.pressure import PRESSURE
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import REFERENCE
from damadics_fd.core.settings import Settings


def estimator_for(settings: Settings) -> Estimator:
    """
    Return the estimator of a mode.

    :param settings: all settings.
    :return: the approximator, or the SCADA-rate monitor in mode `scada`.
    """
    return ScadaEstimator(settings) if settings.mode == 'scada' else Estimator(settings)


class ScadaEstimator(Estimator):
    """
    Estimate the stem at 1 Hz from CV, P1, P2 and judge it by its tests.

    The estimate carries xi1 = r1, the stem residual, and xi2 = largest test statistic over its
    limit, signed as r1: the detector's threshold is then 1.

    :param settings: all settings, of mode `scada`.
    """

    def __init__(self, settings: Settings) -> None:
        self.monitor = ScadaMonitor(
            ScadaSettings(
                period_s=1.0 / min(settings.sample_rate, 1.0),
                t_on_s=settings.t_on,
                learn_from_s=settings.t_w,
                learn_s=settings.t_learn,
                gap_s=settings.gap_reset,
                settle_s=settings.hold,
                days_per_false_alarm=settings.false_alarm_days,
                sigma=settings.sensor_noise,
                actuator=settings.valve(),
            )
        )
        super().__init__(settings)

    def reset(self) -> None:
        """Forget everything: what was learned, the models and the counters."""
        super().reset()
        self.monitor.forget()
        self._ratio = self._residual = 0.0
        self.state['phase'] = PHASE_INIT

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
    ) -> Estimate | None:
        """
        Take one measurement; `t1` and `flow` may be NaN, `ps` is not used.

        :param stamp: these parameters are those of `Estimator.update`.
        :return: the estimate; None where the sample was refused, see `last_rejection`.
        """
        values = (cv, x1, p1, p2, t1, flow, ps)
        q, c = self.quality[0], self._settings[0]
        reason = quality.check_values(c, *values) or quality.check_stamp(q, c, stamp)
        restarted = not q.started
        quality.admit(q, c, stamp, reason)
        if reason:
            self.last_rejection = self._explain(reason, stamp, values)
            return None
        if restarted:
            self.monitor.resume()  # the first sample, or a clock set back
        decision = self.monitor.update(stamp * 1e-9, cv, x1, p1, p2, t1, flow)
        if decision is not None:
            learning = self.monitor.reference is None
            self._residual = 0.0 if math.isnan(decision.r1) else decision.r1
            self._ratio = 0.0 if learning else decision.ratio
            self.state['phase'] = (
                PHASE_LEARN_PHI
                if learning
                else PHASE_MONITOR
                if decision.monitoring
                else PHASE_HOLD
            )
        x = x1 + self.settings.spring_origin
        return Estimate(
            stamp=stamp,
            x2=math.nan,
            x1_hat=x - self._residual,
            x2_hat=math.nan,
            xi1=self._residual,
            xi2=math.copysign(self._ratio, self._residual),
            phi=0.0,
            alpha1=0.0,
            alpha4=0.0,
            alpha5=0.0,
            x1=x1,
            u=cv,
            ps=ps,
            dp=p1 - p2,
            progress=self.monitor.progress,
            phase=int(self.state[0].phase),
        )

    @property
    def status(self) -> str:
        """
        Say in one line what the monitor does.

        :return: for people; never "monitoring" while it does not monitor.
        """
        phase = self.state[0].phase
        if phase == PHASE_MONITOR:
            isolation = self.monitor.isolate()
            return f'monitoring; alarm: {isolation.text()}' if isolation else 'monitoring'
        if phase == PHASE_HOLD:
            return 'on hold: the models settle'
        if phase == PHASE_INIT:
            return 'waiting for the first good sample'
        share = f'learning, {100.0 * self.monitor.progress:.0f} %'
        problem = self.monitor.learning_problem
        return f'{share}: insufficient excitation, {problem}' if problem else share

    def learned(self) -> dict[str, Any]:
        """
        Return what was learned, to be kept over a restart.

        :return: plain numbers and lists by name, fit for JSON.
        :raises ValueError: where learning is not finished.
        """
        reference = self.monitor.reference
        if reference is None:
            raise ValueError(f'nothing to save: {self.status}')
        flat = {name: reference[0][name] for name in _PLAIN}
        flat |= {f'pressure_{name}': reference[0]['pressure'][name] for name in _FILTER}
        return {name: np.asarray(value).tolist() for name, value in flat.items()}

    def restore(self, learned: Mapping[str, Any]) -> None:
        """
        Take up what `learned` returned and monitor as soon as the models have settled.

        :param learned: what was learned.
        :raises ValueError: where it is not that; the monitor is then untouched.
        """
        reference = np.zeros(1, REFERENCE)
        wrong = sorted(set(learned) ^ {*_PLAIN, *(f'pressure_{name}' for name in _FILTER)})
        if wrong:
            raise ValueError(f'learned state: {", ".join(wrong)} missing or unknown')
        for name, value in learned.items():
            part = name.removeprefix('pressure_')
            target = reference[0]['pressure'] if part != name else reference[0]
            try:
                array = np.asarray(value, float)
            except (TypeError, ValueError, OverflowError) as error:
                raise ValueError(f'learned state: {name} = {value!r}: {error}') from error
            if array.shape != np.shape(target[part]) or not np.isfinite(array).all():
                raise ValueError(f'learned state: {name} = {value!r} does not fit')
            target[part] = array
        if not (reference['s1'] > 0.0).all() or not (reference['llr_limit'] > 0.0).all():
            raise ValueError('learned state: s1 and llr_limit must be positive')
        self.monitor = ScadaMonitor(self.monitor.settings, reference)

    def relearn(self, after_repair: bool = False) -> None:
        """
        Learn anew from the next sample on.

        :param after_repair: makes no difference here.
        """
        self.monitor.forget()
        self.state['phase'] = PHASE_LEARN_PHI


_PLAIN = tuple(name for name in REFERENCE.names or () if name != 'pressure')
_FILTER = tuple(PRESSURE.names or ())
