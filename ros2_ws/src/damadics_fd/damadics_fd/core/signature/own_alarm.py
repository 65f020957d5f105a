# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Begin and end of an alarm as the signature sees it."""

from typing import Any

from damadics_fd.core.jit import jit
from damadics_fd.core.signature.air import restart_air, supply_change
from damadics_fd.core.signature.state import (
    CAUSE_NONE,
    CAUSE_SUPPLY,
    CAUSE_UNDETERMINED,
    FAMILY_SUPPLY,
    FAMILY_UNDETERMINED,
    SET_ALARM,
    SET_UNIT,
    STATE_ALARM,
    STATE_MONITOR,
    STATE_VERIFY,
)
from damadics_fd.core.signature.sums import clear_set

P_SUPPLY = 0.95


@jit
def forget_cause(s: Any) -> None:
    """
    Set value, deviation and confidence to 0: unknown.

    :param s: state record.
    """
    s.cause_value = 0.0
    s.cause_std = 0.0
    s.confidence = 0.0


@jit
def start_alarm(s: Any) -> None:
    """
    Begin to collect evidence on an alarm.

    :param s: state record.
    """
    s.state = STATE_ALARM
    s.since = s.t
    s.alarm_t = s.t
    s.b_p_until = s.t
    s.n_alarm = 0.0
    s.stage2 = 0
    s.run_f = 0
    s.run_e = 0
    s.family = FAMILY_UNDETERMINED
    s.cause = CAUSE_UNDETERMINED
    s.second = 0
    forget_cause(s)
    s.r_max = 0.0
    s.stick = 0
    clear_set(s, SET_ALARM)


@jit
def start_supply_alarm(s: Any, c: Any) -> None:
    """
    Raise the own alarm on a loss of supply pressure.

    :param s: state record.
    :param c: settings record.
    """
    start_alarm(s)
    s.own = 1
    s.own_t = s.t
    s.family = FAMILY_SUPPLY
    s.cause = CAUSE_SUPPLY
    s.cause_value = supply_change(s, c)
    s.confidence = P_SUPPLY


@jit
def end_alarm(s: Any) -> None:
    """
    Go back to monitoring (or verifying) with empty sums.

    :param s: state record.
    """
    s.own = 0
    s.own_t = 0
    s.stage2 = 0
    s.family = FAMILY_UNDETERMINED
    s.cause = CAUSE_NONE
    forget_cause(s)
    s.r_max = 0.0
    s.stick = 0
    clear_set(s, SET_ALARM)
    clear_set(s, SET_UNIT)  # after a repair it may be another valve
    restart_sets(s)
    restart_air(s)
    s.state = STATE_MONITOR if s.verified else STATE_VERIFY
    s.since = s.t


@jit
def restart_sets(s: Any) -> None:
    """
    Empty the accumulators of the watch.

    :param s: state record.
    """
    for m in range(SET_ALARM):
        clear_set(s, m)
        s.d_max[m] = 0.0
    s.n_moving = 0
