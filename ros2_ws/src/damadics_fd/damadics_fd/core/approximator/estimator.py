# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The estimator of the modes paper and monitor: one measurement in, one estimate out."""

from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.approximator import guard
from damadics_fd.core.approximator.state import LEARNED, Estimate, State
from damadics_fd.core.approximator.step import (
    estimate_column,
    progress,
    start,
    take_up,
    update,
)
from damadics_fd.core.intake import Intake
from damadics_fd.core.modes import PHASE_HOLD, PHASE_MONITOR, PHASE_PAPER, PHASES
from damadics_fd.core.quality import Refused
from damadics_fd.core.record import Array, Floats, Ints, Plain, Saved
from damadics_fd.core.settings import Settings

STILL = 600.0  # s without motion after which the status says so


class Estimator(Intake):
    """
    Estimate velocity, residual and learned bound from one measurement after the other.

    :param settings: all settings; `settings.mode` chooses paper or monitor mode.

    >>> import math
    >>> estimator = Estimator(Settings.for_mode('paper'))
    >>> estimator.update(0, 1.0, 0.0, 3.5e6, 2.6e6, 20.0, 12.0, math.nan).phase
    4
    >>> estimator.update(2_500_000, 1.0, math.nan, 3.5e6, 2.6e6, 20.0, 12.0, math.nan).text
    'not_finite: x1 = nan'
    """

    stride = 0
    judgement = None

    def __init__(self, settings: Settings) -> None:
        super().__init__(settings)
        self.state = State.rows()
        self._estimate = Estimate.rows()
        self.reset()

    def hold(self, quality: Array, state: Array, estimate: Array | None = None) -> Self:
        """
        Go on with a state that is kept elsewhere, in place.

        :param quality: of the input, an array of length 1 like the following.
        :param state: of the estimator.
        :param estimate: the latest one; None: as before.
        :return: this estimator.
        """
        self.quality, self.state = quality, state
        self._estimate = self._estimate if estimate is None else estimate
        return self

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """Return what it works on: quality, state, settings and estimate, of length 1."""
        return self.quality, self.state, self._settings, self._estimate

    @property
    def latest(self) -> Estimate:
        """Return the latest estimate."""
        return Estimate(*self._estimate.item())

    def reset(self) -> None:
        """Forget everything: what was learned, the filters and the counters."""
        self.forget()
        self.state[:] = State.rows()
        start(self.state, self._settings)

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
        Take one measurement, with the fields of damadics_msgs/Measurement.

        :param stamp: sampling instant [ns].
        :param cv: control value [1].
        :param x1: stem position [1], 0 open, 1 closed.
        :param p1: pressure before the valve [Pa].
        :param p2: pressure behind the valve [Pa].
        :param t1: temperature of the medium [degC].
        :param flow: flow [kg/s].
        :param ps: chamber pressure, gauge [Pa]; NaN where not measured.
        :return: the estimate, or why the sample was refused.
        """
        reason = update(
            self.quality,
            self.state,
            self._settings,
            self._estimate,
            stamp,
            cv,
            x1,
            p1,
            p2,
            t1,
            flow,
            ps,
        )
        if reason:
            return self.note(reason, stamp, (cv, x1, p1, p2, t1, flow, ps), self.last_stamp)
        return self.latest

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
        estimate_column(
            self.quality, self.state, self._settings, reason, estimates, stamp, *signals
        )
        self.note_column(reason, stamp, signals, before)

    @property
    def phase(self) -> str:
        """
        Return the phase of the last estimate.

        :return: a name out of `modes.PHASES`.
        """
        return PHASES[int(self.state[0].phase)]

    @property
    def status(self) -> str:
        """
        Say in one line what the estimator does and, where it learns for long, why.

        :return: for people; never "monitoring" while it does not monitor.
        """
        s, c = self.state[0], self.settings
        if not self.accepted:
            return 'waiting for the first good sample'
        if s.phase == PHASE_HOLD:
            return 'on hold: the input was interrupted, the filters settle'
        still = (s.elapsed - s.rested) * 1e-9
        if s.phase in (PHASE_PAPER, PHASE_MONITOR):
            if still > STILL:
                return (
                    f'monitoring limited, no excitation: the stem has not moved for '
                    f'{still:.0f} s, a change of its friction cannot be seen'
                )
            return 'monitoring'
        share = f'learning, {100.0 * self.progress:.0f} %'
        late = (s.elapsed - s.start) * 1e-9 >= c.t_learn
        if (late or s.unsettled) and c.mode == 'monitor' and guard.unlike(s):
            return (
                f'{share}: the parameters stroke, stiffness, area, preload, plug_diameter ... are '
                'not those of this valve (its force balance has '
                f'{100.0 * float(s.theta[1]):+.0f} % stiffness, '
                f'{float(s.theta[0]) * c.stiffness * c.stroke:+.0f} N offset, leaves '
                f'{float(s.sigma) * c.stiffness * c.stroke:.0f} N): run commission'
            )
        if s.unsettled:
            return (
                f'{share}: learning was refused {int(s.unsettled)} times because the valve '
                f'changed meanwhile ({self._change()}); inspect it, then learn anew'
            )
        if late:
            if s.travel < c.travel_min:
                return (
                    f'{share}: insufficient excitation, {float(s.travel):.2f} of '
                    f'{c.travel_min:.2f} strokes travelled; move the valve both ways'
                )
            return (
                f'{share}: insufficient excitation, the stem moved too little of late or in '
                'one direction only; move the valve both ways over its stroke'
            )
        return share

    @property
    def monitoring(self) -> bool:
        """
        Tell whether decisions count.

        :return: True in the phases `monitor` and `paper`.
        """
        return self.state[0].phase in (PHASE_PAPER, PHASE_MONITOR)

    @property
    def progress(self) -> float:
        """
        Return the share of the learning that is done.

        :return: 0..1.
        """
        return progress(self.state, self._settings)

    def learned(self) -> Saved:
        """
        Return what was learned, to be kept over a restart.

        :return: plain numbers and lists by name, fit for JSON.
        :raises ValueError: where learning is not finished.
        """
        if not (self.accepted if self.settings.mode == 'paper' else self.state['armed'][0]):
            raise ValueError(f'nothing to save: {self.status}')
        return State.plain(self.state, LEARNED)

    def restore(self, learned: Mapping[str, Plain]) -> None:
        """
        Take up what `learned` returned; go to MONITOR as soon as the filters have settled.

        Mode paper has no learning to end: it adapts on from there.

        :param learned: what was learned.
        :raises ValueError: where it is not that, or beyond the bounds of the settings; the
            estimator is then untouched.
        """
        read = State.read(learned, 'learned state', LEARNED)
        state = self.state.copy()
        for name in LEARNED:
            state[name] = read[name]
        self._check_bounds(state)
        if self.settings.mode != 'paper':
            take_up(state)
        self.state[:] = state

    def relearn(self, after_repair: bool = False) -> None:
        """
        Learn anew; filters and counters go on.

        :param after_repair: take the valve as it is now for fault-free; else what is learned has
            to agree with the first block that was ever learned or loaded.
        """
        if after_repair:
            self.state['base'] = 0.0
        self.state['unsettled'] = 0
        self.state['start'] = self.state['elapsed']
        start(self.state, self._settings)

    def _check_bounds(self, state: Array) -> None:
        s, c = state[0], self.settings
        for name, nominal in (('ah1', c.alpha1), ('ah4', c.alpha4), ('ah5', c.alpha5)):
            if abs(s[name] - nominal) > c.band * nominal * (1.0 + 1e-9):
                raise ValueError(
                    f'learned state: {name} = {float(s[name]):g} is not within '
                    f'{100.0 * c.band:g} % of {nominal:g}'
                )
        square = np.sum(s.w1**2) + np.sum(s.w2**2) + s.eps1**2 + s.b1**2
        if square > (c.w_max * (1.0 + 1e-9)) ** 2:
            raise ValueError(f'learned state: the weights exceed w_max = {c.w_max:g}')

    def _change(self) -> str:
        offset, stiffness, friction = self.state[0].change
        force = self.settings.stiffness * self.settings.stroke
        return (
            f'friction {friction * force:+.0f} N, stiffness {100.0 * stiffness:+.1f} %, '
            f'offset {offset * force:+.0f} N'
        )
