# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The valve signature: friction, spring or sensor; small and slow changes; how large."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.jit import jit
from damadics_fd.core.signature_air import supply_lost, track_air
from damadics_fd.core.signature_blocks import add_sample, close_block, judge_block, open_block
from damadics_fd.core.signature_cues import check_passivity, track_stick
from damadics_fd.core.signature_decision import (
    D_VERIFY,
    decide,
    end_alarm,
    restart_sets,
    start_alarm,
    start_supply_alarm,
    watch,
)
from damadics_fd.core.signature_evidence import accumulate, residual
from damadics_fd.core.signature_reference import (
    finish_learning,
    learn_block,
    learning_progress,
    start_learning,
    widen_reference,
)
from damadics_fd.core.signature_types import (
    CAUSES,
    REFERENCE_DTYPE,
    SET_ALARM,
    SET_SLOW,
    STATE_ALARM,
    STATE_DTYPE,
    STATE_INSUFFICIENT,
    STATE_LEARN,
    STATE_MONITOR,
    STATE_UNAVAILABLE,
    STATE_VERIFY,
    SignatureSettings,
    settings_record,
)

QUIET, BLOCK, CHANGED = 0, 1, 2  # what a step returns: nothing new, a block, a new judgement


@jit
def step(
    state: Any, settings: Any, t: int, x: float, ps: float, dp: float, ready: bool, alarm: bool
) -> int:
    """
    Take one accepted sample.

    :param state: structured array of length 1 (STATE_DTYPE).
    :param settings: structured array of length 1 (SETTINGS_DTYPE).
    :param t: [ns] stamp.
    :param x: [1] raw stem position / stroke.
    :param ps: [Pa] chamber pressure, gauge; NaN where not measured.
    :param dp: [Pa] P1 - P2.
    :param ready: False while the filters settle or the input is interrupted.
    :param alarm: the approximator's alarm.
    :return: QUIET, BLOCK (a block was judged) or CHANGED (state, family or cause are new).
    """
    s = state[0]
    c = settings[0]
    if not (ready and math.isfinite(x) and math.isfinite(ps) and math.isfinite(dp)):
        s.run = 0
        s.n = 0
        s.index = -1
        return QUIET
    if s.state == STATE_UNAVAILABLE:
        s.t0 = t
        s.t = t
        s.index = -1
        start_learning(s, c)
    if t <= s.t and s.index >= 0:
        return QUIET  # nothing older than the newest sample is used
    gap = t - s.t
    s.t = t
    result = QUIET
    if alarm != (s.alarm_in != 0):
        s.alarm_in = 1 if alarm else 0
        result = take_alarm(s, c)
    index = (t - s.t0) // c.block_ns
    if index != s.index:
        if s.index >= 0 and close_block(s, c):
            result = max(result, judge(s, c))
        if gap > c.block_ns:
            s.run = 0
        open_block(s, index)
    add_sample(s, c, (t - s.t0) * 1e-9, x, ps, dp)
    return result


@jit
def take_alarm(s: Any, c: Any) -> int:
    """
    Follow an edge of the approximator's alarm.

    :param s: state record.
    :param c: settings record.
    :return: CHANGED.
    """
    learning = s.state == STATE_LEARN or s.state == STATE_INSUFFICIENT
    if learning:
        s.t0 = s.t
        s.index = -1
        s.n = 0
        s.run = 0
        start_learning(s, c)  # what has been seen may be the fault
    elif s.alarm_in != 0 and s.state != STATE_ALARM:
        start_alarm(s)
    elif s.alarm_in == 0 and s.own == 0 and s.state == STATE_ALARM:
        end_alarm(s)
    return CHANGED


@jit
def judge(s: Any, c: Any) -> int:
    """
    Use the middle one of three whole blocks.

    :param s: state record.
    :param c: settings record.
    :return: BLOCK or CHANGED.
    """
    before = s.state * 10000 + s.family * 100 + s.cause
    judge_block(s, c)
    track_stick(s)
    air = track_air(s, c, s.alarm_in == 0 and s.own == 0)
    if s.state == STATE_LEARN or s.state == STATE_INSUFFICIENT:
        if s.alarm_in == 0 and (s.t - s.t0) * 1e-9 >= c.start:
            if s.moving != 0:
                learn_block(s)
            if finish_learning(s, c):
                s.state = STATE_VERIFY
                s.since = s.t
                s.r_max = 0.0
                restart_sets(s)
    else:
        if s.state == STATE_ALARM:
            check_passivity(s, c)
        if s.moving != 0:
            monitor_block(s, c)
        if s.state == STATE_VERIFY:
            finish_verification(s, c)
        elif air and s.state == STATE_MONITOR and supply_lost(s, c):
            start_supply_alarm(s, c)
    return CHANGED if s.state * 10000 + s.family * 100 + s.cause != before else BLOCK


@jit
def monitor_block(s: Any, c: Any) -> None:
    """
    Add a moving block to the sums and weigh them.

    :param s: state record.
    :param c: settings record.
    """
    r = residual(s)
    for m in range(SET_SLOW + 1):
        accumulate(s, m, 1.0 - 1.0 / c.memory[m], r)
    s.n_moving += 1
    if s.state == STATE_ALARM:
        accumulate(s, SET_ALARM, 1.0 - 1.0 / c.memory[SET_ALARM], r)
        decide(s, c)
        return
    watch(s, c)
    if s.own != 0:
        start_alarm(s)


@jit
def finish_verification(s: Any, c: Any) -> None:
    """
    Leave VERIFY and widen the reference by the misfit seen (2.3b).

    :param s: state record.
    :param c: settings record.
    """
    if (s.t - s.since) * 1e-9 < c.verify or s.n_moving < c.verify_blocks:
        return
    worst = max(s.d_max[0], max(s.d_max[1], s.d_max[2]))
    widen_reference(s, math.sqrt(max(1.0, worst / D_VERIFY)))
    restart_sets(s)
    s.verified = 1
    s.state = STATE_MONITOR
    s.since = s.t


@jit
def clear(state: Any) -> None:
    """
    Clear the latched alarm; what follows is judged afresh.

    :param state: structured array of length 1 (STATE_DTYPE).
    """
    s = state[0]
    if s.state == STATE_ALARM:
        s.alarm_in = 0
        end_alarm(s)


@dataclass(frozen=True, slots=True)
class SignatureView:
    """What the signature knows, in the units of damadics_msgs/Signature."""

    state: int
    family: int
    cause: str
    value: float
    std: float
    confidence: float


class Signature:
    """The valve signature of one actuator, sample by sample."""

    def __init__(self, settings: SignatureSettings) -> None:
        self.settings = settings
        self.record = settings_record(settings)
        self.state = np.zeros(1, STATE_DTYPE)

    def update(
        self, t: int, x: float, ps: float, dp: float, ready: bool = True, alarm: bool = False
    ) -> int:
        """
        Take one accepted sample.

        :param t: [ns] stamp.
        :param x: [1] raw stem position / stroke.
        :param ps: [Pa] chamber pressure, gauge; NaN where not measured.
        :param dp: [Pa] P1 - P2.
        :param ready: False while the filters settle or the input is interrupted.
        :param alarm: the approximator's alarm.
        :return: QUIET, BLOCK or CHANGED.
        """
        result: int = step(self.state, self.record, t, x, ps, dp, ready, alarm)
        return result

    def clear(self) -> None:
        """Clear the latched alarm."""
        clear(self.state)

    def relearn(self) -> None:
        """Forget the reference and learn it anew from the next sample on."""
        self.state = np.zeros(1, STATE_DTYPE)

    @property
    def progress(self) -> float:
        """Share of the learning that is done, 0..1."""
        if self.state['state'][0] >= STATE_VERIFY:
            return 1.0
        return float(learning_progress(self.state[0], self.record[0]))

    @property
    def reference(self) -> NDArray[np.void]:
        """What a restarted node needs: copy of the reference, array of length 1."""
        out = np.zeros(1, REFERENCE_DTYPE)
        for name in out.dtype.names or ():
            out[name] = self.state[name]
        return out

    def restore(self, reference: NDArray[np.void]) -> None:
        """
        Start from a saved reference instead of learning.

        :param reference: as returned by `reference`.
        :raises ValueError: if it holds no learned valve.
        """
        if reference.dtype != REFERENCE_DTYPE or not float(reference['sigma'][0]) > 0.0:
            raise ValueError('no valid signature reference: learn the valve again')
        self.state = np.zeros(1, STATE_DTYPE)
        for name in REFERENCE_DTYPE.names or ():
            self.state[name] = reference[name]
        verified = bool(reference['verified'][0])
        self.state['state'] = STATE_MONITOR if verified else STATE_VERIFY
        self.state['index'] = -1

    def view(self) -> SignatureView:
        """Return the present judgement."""
        s = self.state[0]
        return SignatureView(
            int(s.state), int(s.family), CAUSES[int(s.cause)], float(s.cause_value),
            float(s.cause_std), float(s.confidence),
        )
