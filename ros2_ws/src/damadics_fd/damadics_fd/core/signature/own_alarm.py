# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The alarm as the signature sees it: its own, its begin and end, what it means."""

import math

from damadics_fd.core.jit import jit
from damadics_fd.core.signature.air.strokes import restart_air
from damadics_fd.core.signature.air.supply import supply_change, supply_lost
from damadics_fd.core.signature.cause import (
    FULL_EVIDENCE,
    STAGE2_EVIDENCE,
    begin_judgement,
    end_judgement,
    name_supply,
)
from damadics_fd.core.signature.cues import forget_stick, restart_cues
from damadics_fd.core.signature.evidence import clear_set, look, restart_sets
from damadics_fd.core.signature.phase import enter
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.size import MODEL_FRICTION, MODEL_SPRING, at_most, joint_change
from damadics_fd.core.signature.state import (
    CAUSE_ELASTIC,
    CAUSE_FRICTION_DOWN,
    CAUSE_FRICTION_UP,
    CAUSE_SPRING_SOFTER,
    CAUSE_SPRING_STIFFER,
    CAUSE_SUPPLY,
    CAUSE_UNCONFIRMED,
    CAUSE_UNDETERMINED,
    FAMILY_UNCONFIRMED,
    FAMILY_UNDETERMINED,
    SET_ALARM,
    SET_SLOW,
    SET_UNIT,
    STATE_ALARM,
    STATE_MONITOR,
    STATE_VERIFY,
    OwnAlarm,
    State,
)

HYSTERESIS = 0.9  # of a material change


@jit
def watch(s: State, c: SignatureSettings) -> None:
    """
    Look for a change on the three memories before any alarm.

    :param s: state record; own is set if the own alarm is due.
    :param c: settings record.
    """
    for m in range(SET_SLOW + 1):
        if not look(s, c, m):
            continue
        if m == SET_SLOW:
            joint_change(s, c, m)
        if s.over[m] >= c.n_alarm and s.state == STATE_MONITOR and own_alarm_ready(s, c):
            s.own = 1
            s.own_t = s.t
            s.raised_by = max(c.memory[m], c.memory[SET_ALARM])


@jit
def own_alarm_ready(s: State, c: SignatureSettings) -> bool:
    """
    Tell whether the force model is good enough for an own alarm.

    :param s: state record.
    :param c: settings record.
    :return: False where VERIFY found a poor plug force model or the user switched it off.
    """
    allowed: bool = c.own_alarm != 0 and s.verified != 0 and s.kappa <= c.kappa_max
    return allowed


@jit
def start_alarm(s: State, c: SignatureSettings) -> None:
    """
    Begin to collect evidence on an alarm.

    :param s: state record.
    :param c: settings record.
    """
    enter(s, STATE_ALARM, s.t)
    s.alarm_t = s.t
    s.n_alarm = 0.0
    s.without = 0.0
    s.gone = 0
    if s.own == 0:
        s.raised_by = c.memory[SET_ALARM]
    begin_judgement(s)
    restart_cues(s, s.t)
    clear_set(s, SET_ALARM)


@jit
def start_supply_alarm(s: State, c: SignatureSettings) -> None:
    """
    Raise the own alarm on a loss of supply pressure.

    :param s: state record.
    :param c: settings record.
    """
    start_alarm(s, c)
    s.own = 1
    s.own_t = s.t
    name_supply(s, supply_change(s, c))


@jit
def end_alarm(s: State) -> None:
    """
    Go back to monitoring (or verifying) with empty sums.

    :param s: state record.
    """
    s.own = 0
    s.own_t = 0
    end_judgement(s)
    forget_stick(s)
    clear_set(s, SET_ALARM)
    clear_set(s, SET_UNIT)  # after a repair it may be another valve
    restart_sets(s)
    restart_air(s)
    enter(s, STATE_MONITOR if s.verified else STATE_VERIFY, s.t)


@jit
def count_block(s: State) -> None:
    """
    Count a moving block of the alarm.

    :param s: state record.
    """
    s.n_alarm += s.block.w


@jit
def weigh_absence(s: State, c: SignatureSettings) -> None:
    """
    Count how long a moving block has not shown the change: it goes as slowly as it came.

    :param s: state record after `decide`: without, gone in and out.
    :param c: settings record.
    """
    seen = max(s.D[SET_ALARM], s.D[SET_SLOW])
    if s.gone != 0:
        if seen > c.d_alarm:
            s.gone = 0
            s.without = 0.0
        return
    early = s.ne[SET_ALARM] < FULL_EVIDENCE or s.stage2 == 0 or s.ne[SET_SLOW] < STAGE2_EVIDENCE
    # a slow change may hover about the limit on the short record, and is plain on the long one
    s.without = 0.0 if early or seen > c.d_decide else s.without + s.block.age
    if s.without >= s.raised_by:
        s.gone = 1


@jit
def shift_alarm(s: OwnAlarm, shift: int) -> None:
    """
    Follow a clock that was set back.

    :param s: state record.
    :param shift: [ns] new time minus old time.
    """
    s.alarm_t += shift
    s.own_t += shift


@jit
def own_level(s: State, c: SignatureSettings) -> int:
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
    return 1 if s.gone == 0 else 0


@jit
def persists(s: State, c: SignatureSettings) -> bool:
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
    present: bool = s.gone == 0
    return present


@jit
def joint_material(s: State, c: SignatureSettings, share: float) -> bool:
    """
    Tell whether a change without name or size matters, by spring, preload and friction together.

    Temperature changes several at once, so that none of them explains the evidence alone.

    :param s: state record.
    :param c: settings record.
    :param share: of a material change.
    :return: False while the long record since the alarm has no estimate.
    """
    if s.now_t <= s.alarm_t:
        return False
    spring = max(abs(s.now[0]), abs(s.now[1]) / c.force_scale) / c.material_spring
    friction = abs(s.now[2]) / c.material_friction
    return bool(max(spring, friction) >= share)


@jit
def material(s: State, c: SignatureSettings, before: bool) -> bool:
    """
    Tell whether the present change matters for maintenance.

    :param s: state record.
    :param c: settings record.
    :param before: whether it mattered before; a change about the limit does not chatter.
    :return: False for a named friction or spring change that is certainly small, and of the own
        alarm until the size, or what stands for one that is withheld, is known.
    """
    share = HYSTERESIS if before else 1.0
    if s.own != 0 and s.cause in (CAUSE_UNDETERMINED, CAUSE_UNCONFIRMED):
        return joint_material(s, c, share)
    spring = s.second if s.cause == CAUSE_ELASTIC else s.cause
    is_spring = spring in (CAUSE_SPRING_STIFFER, CAUSE_SPRING_SOFTER)
    is_friction = s.cause in (CAUSE_FRICTION_UP, CAUSE_FRICTION_DOWN)
    if math.isnan(s.cause_value):
        withheld = s.own != 0 and (is_friction or is_spring)
        return joint_material(s, c, share) if withheld else True
    if is_friction:
        most = at_most(s.cause_value, s.cause_std, MODEL_FRICTION)
        return bool(most >= share * c.material_friction)
    if is_spring:
        most = at_most(s.cause_value, s.cause_std, MODEL_SPRING)
        return bool(most >= share * c.material_spring)
    return True
