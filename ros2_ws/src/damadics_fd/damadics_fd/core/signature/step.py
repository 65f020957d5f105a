# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The step of the valve signature: from a sample to blocks, reference, evidence and cause."""

import math

from damadics_fd.core.jit import jit, layer
from damadics_fd.core.signature.air.strokes import strokes_agree, track_air
from damadics_fd.core.signature.air.supply import supply_lost
from damadics_fd.core.signature.blocks import (
    add_sample,
    break_run,
    close_block,
    interrupt,
    judge_block,
    let_grow,
    open_block,
)
from damadics_fd.core.signature.cause import STAGE2_STRONG, decide
from damadics_fd.core.signature.cues import (
    check_passivity,
    restart_range,
    shift_cues,
    stick_evidence,
    track_stick,
)
from damadics_fd.core.signature.evidence import D_VERIFY, clear_set, restart_sets
from damadics_fd.core.signature.own_alarm import (
    count_block,
    end_alarm,
    shift_alarm,
    start_alarm,
    start_supply_alarm,
    watch,
    weigh_absence,
)
from damadics_fd.core.signature.phase import count_moving, enter, shift_phase
from damadics_fd.core.signature.reference import (
    finish_learning,
    learn_block,
    refine_unit,
    solve_reference,
    start_learning,
    widen_reference,
)
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import (
    SET_ALARM,
    SET_SLOW,
    SET_UNIT,
    STATE_ALARM,
    STATE_INSUFFICIENT,
    STATE_LEARN,
    STATE_MONITOR,
    STATE_UNAVAILABLE,
    STATE_VERIFY,
    State,
)
from damadics_fd.core.signature.sums import accumulate, copy_sums, growth_time, residual

BREAK_AWAY = 2  # blocks of a stroke in which strong friction is still more than when sliding
QUIET, BLOCK, CHANGED = 0, 1, 2  # what a step returns: nothing new, a block, a new judgement


@jit
def pass_by(
    s: State,
    c: SignatureSettings,
    t: int,
    x: float,
    ps: float,
    dp: float,
    ready: bool,
    alarm: bool,
) -> bool:
    """
    Take a sample within the block under construction, as nearly always: `step` without its cost.

    The arguments are those of `step`.

    :return: False where `step` has to be taken; the record is then as it was.
    """
    if not c.available:
        return True
    if not (ready and math.isfinite(x) and math.isfinite(ps) and math.isfinite(dp)):
        return False
    if s.state == STATE_UNAVAILABLE or t <= s.t or alarm != (s.alarm_in != 0):
        return False
    within = t - s.t0 - s.index * c.block_ns  # a division saved
    if s.index < 0 or within < 0 or within >= c.block_ns:
        return False
    s.t = t
    add_sample(s, c, (t - s.t0) * 1e-9, x, ps, dp)
    return True


@jit
def step(
    s: State,
    c: SignatureSettings,
    t: int,
    x: float,
    ps: float,
    dp: float,
    ready: bool,
    alarm: bool,
) -> int:
    """
    Take one accepted sample.

    :param s: state record.
    :param c: settings record.
    :param t: [ns] stamp.
    :param x: [1] raw stem position / stroke.
    :param ps: [Pa] chamber pressure, gauge; NaN where not measured.
    :param dp: [Pa] P1 - P2.
    :param ready: False while the filters settle or the input is interrupted.
    :param alarm: an alarm is present or latched, whoever raised it.
    :return: QUIET, BLOCK (a block was judged) or CHANGED (state, family or cause are new).
    """
    if not c.available:
        return QUIET
    if not (ready and math.isfinite(x) and math.isfinite(ps) and math.isfinite(dp)):
        interrupt(s)
        return QUIET
    if s.state == STATE_UNAVAILABLE:
        s.t0 = t
        s.t = t
        interrupt(s)
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
            break_run(s)
        open_block(s, index)
    add_sample(s, c, (t - s.t0) * 1e-9, x, ps, dp)
    return result


@jit
def take_alarm(s: State, c: SignatureSettings) -> int:
    """
    Follow an edge of the alarm.

    :param s: state record.
    :param c: settings record.
    :return: CHANGED.
    """
    learning = s.state == STATE_LEARN or s.state == STATE_INSUFFICIENT
    if learning:
        s.t0 = s.t
        interrupt(s)
        start_learning(s, c)  # what has been seen may be the fault
    elif s.alarm_in != 0 and s.state != STATE_ALARM:
        start_alarm(s, c)
    elif s.alarm_in == 0 and s.state == STATE_ALARM:
        end_alarm(s)
    return CHANGED


@jit
def shift_clock(s: State, shift: int) -> None:
    """
    Go on after an interruption in which the clock was set back.

    :param s: state record.
    :param shift: [ns] new time minus old time.
    """
    s.t += shift
    s.t0 += shift
    shift_phase(s, shift)
    shift_alarm(s, shift)
    shift_cues(s, shift)


@layer
def judge(s: State, c: SignatureSettings) -> int:
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
            if s.block.moving != 0:
                learn_block(s)
            if finish_learning(s, c):
                enter(s, STATE_VERIFY, s.t)
                restart_range(s)
                restart_sets(s)
    else:
        if s.state == STATE_ALARM:
            check_passivity(s, c)
        news = s.state == STATE_ALARM and s.block.standing != 0 and stick_evidence(s) > 0.0
        told = s.block.moving != 0 and fresh and monitor_block(s, c)
        if news or told:
            decide(s, c)
        if told:
            weigh_absence(s, c)
        if s.state == STATE_VERIFY:
            finish_verification(s, c)
        elif (
            air
            and s.state == STATE_MONITOR
            and c.own_alarm
            and supply_lost(s, c)
            and strokes_agree(s, c)
        ):
            start_supply_alarm(s, c)
    return CHANGED if s.state * 10000 + s.family * 100 + s.cause != before else BLOCK


@jit
def since_alarm(s: State, c: SignatureSettings) -> bool:
    """
    Tell whether the middle block began after the alarm.

    :param s: state record.
    :param c: settings record.
    :return: False for a block that mixes before and after.
    """
    began: bool = s.bt[1] - 0.5 * c.block >= (s.alarm_t - s.t0) * 1e-9
    return began


@layer
def monitor_block(s: State, c: SignatureSettings) -> bool:
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
        accumulate(s, m, 1.0 - s.block.age / c.memory[m], r)
    count_moving(s, s.block.age)
    if s.state == STATE_ALARM:
        let_grow(s, growth_time(s))
        accumulate(s, SET_ALARM, 1.0 - s.block.age / c.memory[SET_ALARM], r)
        count_block(s)
        return True
    if s.state == STATE_VERIFY:
        learn_block(s)
    watch(s, c)
    if s.own != 0:
        start_alarm(s, c)
    elif s.state == STATE_MONITOR and max(s.D[0], max(s.D[1], s.D[2])) < D_VERIFY:
        refine_unit(s, c)
    return False


@jit
def finish_verification(s: State, c: SignatureSettings) -> None:
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
    copy_sums(s, SET_UNIT, SET_ALARM)
    clear_set(s, SET_ALARM)
    widen_reference(s, math.sqrt(max(1.0, worst / D_VERIFY)))
    restart_sets(s)
    enter(s, STATE_MONITOR, s.t)
