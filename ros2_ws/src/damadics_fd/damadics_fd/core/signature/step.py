# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The step of the valve signature: from a sample to blocks, reference, evidence and cause."""

import math
from typing import Any

from damadics_fd.core.jit import jit, layer
from damadics_fd.core.signature.air import strokes_agree, supply_lost, track_air
from damadics_fd.core.signature.blocks import add_sample, close_block, judge_block, open_block
from damadics_fd.core.signature.cause import (
    D_VERIFY,
    FULL_EVIDENCE,
    STAGE2_EVIDENCE,
    STAGE2_STRONG,
    decide,
    watch,
)
from damadics_fd.core.signature.cues import check_passivity, stick_evidence, track_stick
from damadics_fd.core.signature.own_alarm import (
    end_alarm,
    restart_sets,
    start_alarm,
    start_supply_alarm,
)
from damadics_fd.core.signature.reference import (
    finish_learning,
    learn_block,
    refine_unit,
    solve_reference,
    start_learning,
    widen_reference,
)
from damadics_fd.core.signature.state import (
    CAUSE_FRICTION_DOWN,
    CAUSE_FRICTION_UP,
    CAUSE_SPRING_SOFTER,
    CAUSE_SPRING_STIFFER,
    CAUSE_SUPPLY,
    CAUSE_UNDETERMINED,
    FAMILY_UNCONFIRMED,
    FAMILY_UNDETERMINED,
    SET_ALARM,
    SET_SLOW,
    SET_UNIT,
    SIGN,
    SIGN_T,
    STATE_ALARM,
    STATE_INSUFFICIENT,
    STATE_LEARN,
    STATE_MONITOR,
    STATE_UNAVAILABLE,
    STATE_VERIFY,
    X1,
    X1_T,
)
from damadics_fd.core.signature.sums import (
    accumulate,
    clear_set,
    copy_set,
    growth_time,
    residual,
)

HYSTERESIS = 0.9  # of a material change
BREAK_AWAY = 2  # blocks of a stroke in which strong friction is still more than when sliding
QUIET, BLOCK, CHANGED = 0, 1, 2  # what a step returns: nothing new, a block, a new judgement


@jit
def step(s: Any, c: Any, t: int, x: float, ps: float, dp: float, ready: bool, alarm: bool) -> int:
    """
    Take one accepted sample; its arguments are those of `Signature.update`.

    :param s: state record.
    :param c: settings record.
    :return: QUIET, BLOCK (a block was judged) or CHANGED (state, family or cause are new).
    """
    if c.available == 0:
        return QUIET
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
    if t < s.t:
        shift_clock(s, t - s.t)
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
    Follow an edge of the alarm.

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
    elif s.alarm_in == 0 and s.state == STATE_ALARM:
        end_alarm(s)
    return CHANGED


@jit
def shift_clock(s: Any, shift: int) -> None:
    """
    Go on after an interruption in which the clock was set back.

    :param s: state record.
    :param shift: [ns] new time minus old time.
    """
    s.t += shift
    s.t0 += shift
    s.since += shift
    s.alarm_t += shift
    s.own_t += shift
    s.b_p_until += shift


@jit
def own_level(s: Any, c: Any) -> int:
    """
    Tell the detector whether the own alarm's condition is present.

    :param s: state record.
    :param c: settings record.
    :return: 1 while it is, else 0.
    """
    if s.own == 0:
        return 0
    if s.cause == CAUSE_SUPPLY:
        return 1 if supply_lost(s, c) else 0
    if s.ne[SET_ALARM] < FULL_EVIDENCE or s.stage2 == 0 or s.ne[SET_SLOW] < STAGE2_EVIDENCE:
        return 1
    # a slow change may hover about the limit on the short record, and is plain on the long one
    return 1 if max(s.D[SET_ALARM], s.D[SET_SLOW]) > c.d_decide else 0


@jit
def persists(s: Any, c: Any) -> bool:
    """
    Tell whether a named change is still there, as the evidence since the alarm says.

    :param s: state record.
    :param c: settings record.
    :return: True while neither alarm may end.
    """
    if s.state != STATE_ALARM or s.family in (FAMILY_UNDETERMINED, FAMILY_UNCONFIRMED):
        return False
    if s.cause == CAUSE_SUPPLY:
        return supply_lost(s, c)
    present: bool = max(s.D[SET_ALARM], s.D[SET_SLOW]) > c.d_decide
    return present


@jit
def material(s: Any, c: Any, before: bool) -> bool:
    """
    Tell whether the present change matters for maintenance.

    :param s: state record.
    :param c: settings record.
    :param before: whether it mattered before; a change about the limit does not chatter.
    :return: False for a named friction or spring change that is certainly small, and of the own
        alarm until the size is known.
    """
    if s.cause == CAUSE_UNDETERMINED and s.own != 0:
        return bool((s.t - s.alarm_t) * 1e-9 >= c.unconfirmed_after)
    if math.isnan(s.cause_value):
        return True
    share = HYSTERESIS if before else 1.0
    most = abs(s.cause_value) + 2.0 * s.cause_std
    if s.cause in (CAUSE_FRICTION_UP, CAUSE_FRICTION_DOWN):
        return bool(most >= share * c.material_friction)
    if s.cause in (CAUSE_SPRING_STIFFER, CAUSE_SPRING_SOFTER):
        return bool(most >= share * c.material_spring)
    return True


@layer
def judge(s: Any, c: Any) -> int:
    """
    Use the middle one of three whole blocks.

    :param s: state record.
    :param c: settings record.
    :return: BLOCK or CHANGED.
    """
    before = s.state * 10000 + s.family * 100 + s.cause
    judge_block(s, c)
    fresh = s.state != STATE_ALARM or since_alarm(s, c)
    if fresh:
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
        news = s.state == STATE_ALARM and s.standing != 0 and stick_evidence(s) > 0.0
        if s.moving != 0 and fresh:
            news = monitor_block(s, c)
        if news:
            decide(s, c)
        if s.state == STATE_VERIFY:
            finish_verification(s, c)
        elif (
            air
            and s.state == STATE_MONITOR
            and c.own_alarm != 0
            and supply_lost(s, c)
            and strokes_agree(s)
        ):
            start_supply_alarm(s, c)
    return CHANGED if s.state * 10000 + s.family * 100 + s.cause != before else BLOCK


@jit
def since_alarm(s: Any, c: Any) -> bool:
    """
    Tell whether the middle block began after the alarm.

    :param s: state record.
    :param c: settings record.
    :return: False for a block that mixes before and after.
    """
    began: bool = s.bt[1] - 0.5 * c.block >= (s.alarm_t - s.t0) * 1e-9
    return began


@layer
def monitor_block(s: Any, c: Any) -> bool:
    """
    Add a moving block to the sums and, where there is no alarm, look for one.

    :param s: state record.
    :param c: settings record.
    :return: True if there is news on an alarm.
    """
    r = residual(s)
    for m in range(SET_SLOW + 1):
        if m == SET_SLOW and s.stage2 == STAGE2_STRONG and s.slide <= BREAK_AWAY:
            continue
        accumulate(s, m, 1.0 - 1.0 / c.memory[m], r)
    s.n_moving += 1
    if s.state == STATE_ALARM:
        tau = growth_time(s)
        s.ph[SIGN_T] = s.ph[SIGN] * tau
        s.ph[X1_T] = s.ph[X1] * tau
        accumulate(s, SET_ALARM, 1.0 - 1.0 / c.memory[SET_ALARM], r)
        s.n_alarm += s.w
        return True
    if s.state == STATE_VERIFY:
        learn_block(s)
    watch(s, c)
    if s.own != 0:
        start_alarm(s)
    elif s.state == STATE_MONITOR and max(s.D[0], max(s.D[1], s.D[2])) < D_VERIFY:
        refine_unit(s, c)
    return False


@jit
def finish_verification(s: Any, c: Any) -> None:
    """
    Leave VERIFY and widen the reference by the misfit seen.

    :param s: state record.
    :param c: settings record.
    """
    if (s.t - s.since) * 1e-9 < c.verify or s.n_moving < c.verify_blocks:
        return
    worst = max(s.d_max[0], max(s.d_max[1], s.d_max[2]))
    if s.ne[SET_ALARM] > s.n_learn:
        solve_reference(s, c)  # from LEARN and VERIFY: the size of a change rests on it
    copy_set(s, SET_UNIT, SET_ALARM)
    clear_set(s, SET_ALARM)
    widen_reference(s, math.sqrt(max(1.0, worst / D_VERIFY)))
    restart_sets(s)
    s.verified = 1
    s.state = STATE_MONITOR
    s.since = s.t
