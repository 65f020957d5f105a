# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""From evidence to a named cause: families first, "undetermined" as an honest answer."""

import math

from damadics_fd.core.jit import jit, layer
from damadics_fd.core.signature.cues import stick_evidence
from damadics_fd.core.signature.evidence import clear_set, due, evaluate
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.size import joint_change, physical_value, size_beside_offset
from damadics_fd.core.signature.state import (
    CAUSE_ELASTIC,
    CAUSE_FRICTION_DOWN,
    CAUSE_FRICTION_UP,
    CAUSE_NONE,
    CAUSE_PRELOAD,
    CAUSE_SPRING_SOFTER,
    CAUSE_SPRING_STIFFER,
    CAUSE_STICK_PLAY,
    CAUSE_SUPPLY,
    CAUSE_UNCONFIRMED,
    CAUSE_UNDETERMINED,
    FAMILY_ELASTIC,
    FAMILY_FRICTION,
    FAMILY_SUPPLY,
    FAMILY_UNCONFIRMED,
    FAMILY_UNDETERMINED,
    FRICTION,
    N_HYP,
    ONE,
    PRELOAD,
    SET_ALARM,
    SET_FAST,
    SET_SLOW,
    SPRING,
    X1,
    Cause,
    State,
)

FULL_EVIDENCE = 18.0  # blocks since the alarm, from which the fast set holds nothing older
NULL_MOVING = 12.0  # blocks since the alarm
NULL_STICK = 1.5  # stick range / reference; a healthy valve reaches 1.44
NULL_D = 15.0  # less evidence of the moving stem than this is none
FLIP = 10  # evaluated blocks in a row that overturn a firm family
P_LONG = 0.99  # names a family by the long record alone
P_STICK = 0.96
P_SUPPLY = 0.95
STAGE2_EVIDENCE = 30.0
STAGE2_STRIDE = 5
STAGE2_SETTLED, STAGE2_STRONG = 2, 3
SETTLED = 30.0  # [s] after the alarm: from then on the long record sizes a friction change
STRONG = 1.0  # friction change of which the long record begins anew then
TELLING = 0.2  # of the stroke: range that tells the members of the elastic family apart


@jit
def forget_cause(s: Cause) -> None:
    """
    Set value, deviation and confidence to 0: unknown.

    :param s: state record.
    """
    s.cause_value = 0.0
    s.cause_std = 0.0
    s.confidence = 0.0


@jit
def begin_judgement(s: Cause) -> None:
    """
    Judge an alarm that begins.

    :param s: state record.
    """
    s.stage2 = 0
    s.run_f = 0
    s.run_e = 0
    s.family = FAMILY_UNDETERMINED
    s.cause = CAUSE_UNDETERMINED
    s.second = 0
    forget_cause(s)


@jit
def end_judgement(s: Cause) -> None:
    """
    Name no cause: there is no alarm.

    :param s: state record.
    """
    s.stage2 = 0
    s.family = FAMILY_UNDETERMINED
    s.cause = CAUSE_NONE
    forget_cause(s)


@jit
def name_supply(s: Cause, change: float) -> None:
    """
    Report a loss of supply pressure.

    :param s: state record.
    :param change: [Pa].
    """
    s.family = FAMILY_SUPPLY
    s.cause = CAUSE_SUPPLY
    s.cause_value = change
    s.confidence = P_SUPPLY


@jit
def decide(s: State, c: SignatureSettings) -> None:
    """
    Judge the alarm after a moving block, or a standing one that widened the stick range.

    :param s: state record; family, cause, value, std and confidence are written.
    :param c: settings record.
    """
    b_r = stick_evidence(s)
    b_p = 6.0 if s.t < s.b_p_until and s.ne[SET_ALARM] < STAGE2_EVIDENCE else 0.0
    m = SET_ALARM
    D = evaluate(s, c, m, c.model_error, b_r, b_p)
    if s.ne[SET_ALARM] >= FULL_EVIDENCE and evaluate(s, c, SET_FAST, c.model_error, b_r, b_p) > D:
        m = SET_FAST
        D = s.D[m]
    if c.d_decide < D:
        p_f = math.exp(s.logp[m][FRICTION])
        s.run_f = s.run_f + 1 if p_f > c.p_firm else 0
        s.run_e = s.run_e + 1 if 1.0 - p_f > c.p_firm else 0
        if s.run_f >= (FLIP if s.family == FAMILY_ELASTIC else c.n_firm):
            s.family = FAMILY_FRICTION
        elif s.run_e >= (FLIP if s.family == FAMILY_FRICTION else c.n_firm):
            s.family = FAMILY_ELASTIC
        if s.family == FAMILY_FRICTION and p_f > 0.5:
            if moving_unchanged(s, c, D - 2.0 * b_r):
                name_stick(s, p_f)
            else:
                name_friction(s, c, m, p_f)
        elif s.family == FAMILY_ELASTIC and p_f < 0.5:
            name_elastic(s, c, m, 1.0 - p_f)
    elif (
        s.r_max > NULL_STICK * s.r_ref
        and s.n_alarm >= NULL_MOVING
        and moving_unchanged(s, c, D - 2.0 * b_r)
    ):
        s.run_e = 0
        s.run_f += 1
        if s.run_f >= c.n_firm:
            s.family = FAMILY_FRICTION
            name_stick(s, P_STICK)
    else:
        s.run_f = 0
        s.run_e = 0
        doubt(s, c)
    second_stage(s, c)


@jit
def moving_unchanged(s: State, c: SignatureSettings, D: float) -> bool:
    """
    Tell whether the moving stem shows no change, neither of late nor on the long record.

    :param s: state record.
    :param c: settings record.
    :param D: evidence of the moving stem on the short record.
    :return: True if only the standing stem can explain the alarm.
    """
    long = s.stage2 != 0 and s.D[SET_SLOW] > c.d_decide
    unchanged: bool = D < NULL_D and not long
    return unchanged


@jit
def doubt(s: State, c: SignatureSettings) -> None:
    """
    Say so if the moving valve does not confirm an alarm.

    :param s: state record.
    :param c: settings record.
    """
    waited = (s.t - s.alarm_t) * 1e-9 >= c.unconfirmed_after
    if waited and s.n_alarm >= NULL_MOVING and s.family == FAMILY_UNDETERMINED:
        s.family = FAMILY_UNCONFIRMED
        s.cause = CAUSE_UNCONFIRMED


@jit
def name_stick(s: State, p: float) -> None:
    """
    Report friction or play that only the standing stem shows.

    :param s: state record.
    :param p: probability.
    """
    s.cause = CAUSE_STICK_PLAY
    s.confidence = p
    s.cause_value = s.r_max / s.r_ref - 1.0
    s.cause_std = 0.0


@jit
def name_friction(s: State, c: SignatureSettings, m: int, p: float) -> None:
    """
    Report a firm friction change.

    :param s: state record.
    :param c: settings record.
    :param m: set with the evidence.
    :param p: posterior of friction.
    """
    s.confidence = p
    if s.stage2 >= STAGE2_SETTLED and s.D[SET_SLOW] > 0.0:
        m = SET_SLOW  # as the last stage 2 left it
    s.cause_value, s.cause_std = physical_value(s, c, m, FRICTION)
    s.cause = CAUSE_FRICTION_UP if s.value[m][FRICTION] >= 0.0 else CAUSE_FRICTION_DOWN


@jit
def name_elastic(s: State, c: SignatureSettings, m: int, p: float) -> None:
    """
    Report a firm change of the elastic family, by the spring until stage 2 knows better.

    :param s: state record.
    :param c: settings record.
    :param m: set with the evidence.
    :param p: posterior of the family.
    """
    if s.cause >= CAUSE_SPRING_STIFFER:
        return  # named by stage 2
    s.cause = CAUSE_ELASTIC
    s.confidence = p
    best = likeliest(s, m)
    s.cause_value, s.cause_std = physical_value(s, c, m, best)
    s.second = cause_of(best, s.cause_value)


@jit
def likeliest(s: State, m: int) -> int:
    """
    Return the likeliest hypothesis of the elastic family.

    :param s: state record.
    :param m: set with the evidence.
    :return: SPRING to POSITION_OFFSET.
    """
    best = SPRING
    for h in range(PRELOAD, N_HYP):
        if s.logp[m][h] > s.logp[m][best]:
            best = h
    return best


@jit
def cause_of(h: int, value: float) -> int:
    """
    Name a hypothesis of the elastic family.

    :param h: SPRING to POSITION_OFFSET.
    :param value: its change.
    :return: a CAUSE constant.
    """
    if h == SPRING:
        return CAUSE_SPRING_STIFFER if value >= 0.0 else CAUSE_SPRING_SOFTER
    return CAUSE_PRELOAD + h - PRELOAD


@layer
def second_stage(s: State, c: SignatureSettings) -> None:
    """
    Name the member of the elastic family from a longer record after the alarm.

    :param s: state record.
    :param c: settings record.
    """
    if s.stage2 == 0:
        if (s.t - s.alarm_t) * 1e-9 >= c.stage2_delay:
            s.stage2 = 1
            clear_set(s, SET_SLOW)
        return
    settled = (s.t - s.alarm_t) * 1e-9 >= SETTLED
    if s.stage2 == 1 and s.family == FAMILY_FRICTION and settled:
        s.stage2 = STAGE2_SETTLED
        if abs(s.cause_value) > STRONG:
            s.stage2 = STAGE2_STRONG
            clear_set(s, SET_SLOW)  # it holds the growth of the fault; of a small one all counts
    m = SET_SLOW
    if not due(s, m, STAGE2_STRIDE, s.ne[m] >= STAGE2_EVIDENCE):
        return
    D = evaluate(s, c, m, c.model_error_stage2, 0.0, 0.0)
    if s.D[m] > 0.0:
        size_beside_offset(s, c, m, c.model_error_stage2)
    joint_change(s, c, m)
    if c.d_decide >= D:
        return
    if s.family in (FAMILY_UNDETERMINED, FAMILY_UNCONFIRMED):
        # too small a change for the shorter sets
        p_f = math.exp(s.logp[m][FRICTION])
        if p_f > P_LONG:
            s.family = FAMILY_FRICTION
            name_friction(s, c, m, p_f)
        elif 1.0 - p_f > P_LONG:
            s.family = FAMILY_ELASTIC
    if s.family != FAMILY_ELASTIC:
        return
    best = likeliest(s, m)
    total = 0.0
    for h in range(SPRING, N_HYP):
        total += math.exp(s.logp[m][h])
    p = math.exp(s.logp[m][best]) / max(total, 1e-300)
    s.cause_value, s.cause_std = physical_value(s, c, m, best)
    s.second = cause_of(best, s.cause_value)
    s.confidence = p
    s.cause = s.second if p > c.p_firm and ranged(s, m) else CAUSE_ELASTIC


@jit
def ranged(s: State, m: int) -> bool:
    """
    Tell whether the stem went far enough to tell spring, preload and sensors apart.

    At one operating point they are one column; a range r of it has the deviation r / sqrt(12).

    :param s: state record.
    :param m: index of the set.
    :return: True where it did.
    """
    mean = s.S[m][X1, ONE] / s.ne[m]
    variance = s.S[m][X1, X1] / s.ne[m] - mean * mean
    return bool(variance * 12.0 > TELLING * TELLING)
