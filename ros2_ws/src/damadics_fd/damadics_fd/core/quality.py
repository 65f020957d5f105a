# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Check of one sample before it may touch any filter state."""

import math
from enum import IntEnum
from typing import Annotated, NamedTuple

from damadics_fd.core.jit import jit
from damadics_fd.core.modes import MONITOR
from damadics_fd.core.record import Ints, Record
from damadics_fd.core.settings import Settings


class Reason(IntEnum):
    """Say why a sample was refused."""

    ACCEPTED = 0
    NOT_FINITE = 1
    OUT_OF_RANGE = 2
    ZERO_STAMP = 3
    DUPLICATE = 4
    OUT_OF_ORDER = 5
    SPIKE = 6


REASONS = tuple(reason.name.lower() for reason in Reason)
ACCEPTED, NOT_FINITE, OUT_OF_RANGE, ZERO_STAMP, DUPLICATE, OUT_OF_ORDER, SPIKE = map(int, Reason)
BEYOND = 1e9  # degC or kg/s: the mark of a corrupt sample
EXPLANATIONS = {
    'not_finite': 'a needed signal is missing, NaN or infinite',
    'out_of_range': 'a signal is outside its range: sensor failure or wrong unit',
    'zero_stamp': 'header.stamp is 0: the driver does not stamp its samples',
    'duplicate': 'header.stamp equals that of the sample before',
    'out_of_order': 'header.stamp is before that of the sample before',
    'spike': 'a signal was another for one sample, by more than a valve can do',
}
REMEDIES = {
    'not_finite': 'check its transmitter and wiring; what the mode does not need may be NaN',
    'out_of_range': 'check transmitter, unit (fractions, Pa) and the range in the settings',
    'zero_stamp': 'let the driver stamp its samples',
    'duplicate': 'let one driver only send, each sample once',
    'out_of_order': 'let one driver only send, in order of time',
    'spike': 'check wiring, screen and earth of its transmitter',
}


class Refused(NamedTuple):
    """Hold why one sample never reached the filters."""

    reason: Reason
    text: str  # the name of the reason, then signal and value, or both stamps
    signal: str = ''  # out of SIGNALS, where one of them is the reason

    @property
    def name(self) -> str:
        """
        Return the name of the reason.

        :return: a name out of REASONS.
        """
        return REASONS[self.reason]

    @property
    def explanation(self) -> str:
        """
        Say what the reason means.

        :return: one clause.
        """
        return EXPLANATIONS[self.name]

    @property
    def remedy(self) -> str:
        """
        Say what to do.

        :return: one clause.
        """
        return REMEDIES[self.name]


class Quality(Record):
    """Remember the last sample that was accepted, and count what was not."""

    stamp: int  # of the last accepted sample
    started: bool
    counts: Annotated[Ints, len(REASONS)]
    gaps: int
    missed: int  # gaps that were bridged, samples missing in them
    restarts: int
    clock_jumps: int
    refused_in_a_row: int
    jump_stamp: int
    jump_count: int  # samples in order after a clock set back
    x1: float  # of the last accepted sample in mode monitor
    p1: float
    p2: float
    ps: float
    spike: int  # place in SIGNALS of the last one that was wrong alone
    held_x1: float  # of a sample that is held back, NaN where none is
    held_p1: float
    held_p2: float
    held_ps: float


@jit
def value_fault(value: float, low: float, high: float, needed: bool) -> int:
    """
    Judge one signal.

    :param value: the signal; NaN is "not measured".
    :param low: lower end of its range.
    :param high: upper end of its range.
    :param needed: refuse NaN as well.
    :return: ACCEPTED, NOT_FINITE or OUT_OF_RANGE.
    """
    if math.isnan(value):
        return NOT_FINITE if needed else ACCEPTED
    if math.isinf(value):
        return NOT_FINITE
    return ACCEPTED if low <= value <= high else OUT_OF_RANGE


@jit
def signal_fault(c: Settings, index: int, value: float) -> int:
    """
    Judge one signal by its place in SIGNALS.

    All modes need cv and x1, mode monitor also p1, p2 and ps. What is not needed may be NaN;
    temperature and flow are refused only where they are infinite or beyond any range, the mark
    of a corrupt sample.

    :param c: settings record.
    :param index: place in SIGNALS.
    :param value: the signal.
    :return: ACCEPTED, NOT_FINITE or OUT_OF_RANGE.
    """
    force = c.mode_code == MONITOR
    drop = force  # mode scada goes on without pressures
    if index <= 1:
        return value_fault(value, c.signal_low, c.signal_high, True)
    if index <= 3:
        return value_fault(value, -0.025 * c.p_max, c.p_max, drop)
    if index == 6:
        return value_fault(value, -0.025 * c.ps_max, c.ps_max, force)
    return value_fault(value, -BEYOND, BEYOND, False)


@jit
def check_values(
    c: Settings, cv: float, x1: float, p1: float, p2: float, t1: float, flow: float, ps: float
) -> int:
    """
    Judge the signals of a sample.

    :param c: settings record.
    :param cv: control value [1].
    :param x1: stem position [1].
    :param p1: pressure before the valve [Pa].
    :param p2: pressure behind the valve [Pa].
    :param t1: temperature [degC].
    :param flow: flow [kg/s].
    :param ps: chamber pressure [Pa].
    :return: ACCEPTED or the reason of the first signal to be refused.
    """
    if (
        c.signal_low <= cv <= c.signal_high
        and c.signal_low <= x1 <= c.signal_high
        and -0.025 * c.p_max <= p1 <= c.p_max
        and -0.025 * c.p_max <= p2 <= c.p_max
        and -0.025 * c.ps_max <= ps <= c.ps_max
        and abs(t1) <= BEYOND
        and abs(flow) <= BEYOND
    ):
        return ACCEPTED  # nearly always; what follows costs ten times as much
    for index, value in enumerate((cv, x1, p1, p2, t1, flow, ps)):
        reason = signal_fault(c, index, value)
        if reason != ACCEPTED:
            return reason
    return ACCEPTED


@jit
def check_stamp(q: Quality, c: Settings, stamp: int) -> int:
    """
    Judge the stamp of a sample with good values.

    A stamp of 0 is good for the very first sample only: scenario zero. Stamps that stay far
    behind and in order among themselves are a clock set back, not disorder: then the last of
    them is accepted, with `q.started` off, so that the filters start afresh.

    :param q: quality record.
    :param c: settings record.
    :param stamp: stamp [ns].
    :return: ACCEPTED or the reason of refusal.
    """
    if not q.started:
        if stamp < 0:
            return OUT_OF_ORDER
        return ACCEPTED if stamp > 0 or q.counts[ACCEPTED] == 0 else ZERO_STAMP
    if stamp > q.stamp:
        q.jump_count = 0
        return ACCEPTED
    if stamp == 0:
        return ZERO_STAMP
    if stamp == q.stamp:
        return DUPLICATE
    if stamp < 0 or q.stamp - stamp < c.clock_jump * 1e9:
        return OUT_OF_ORDER
    q.jump_count = q.jump_count + 1 if q.jump_count > 0 and stamp > q.jump_stamp else 1
    q.jump_stamp = stamp
    if q.jump_count < c.clock_jump_samples:
        return OUT_OF_ORDER
    q.jump_count = 0
    q.clock_jumps += 1
    q.started = False
    return ACCEPTED


@jit
def admit(q: Quality, c: Settings, stamp: int, reason: int) -> tuple[float, bool]:
    """
    Count a judged sample and return its time step.

    :param q: quality record.
    :param c: settings record.
    :param stamp: stamp [ns].
    :param reason: result of the checks.
    :return: time since the last accepted sample [s], the nominal step where the filters have to
        start afresh, 0 for a refused sample; whether they have to.
    """
    q.counts[reason] += 1
    if reason != ACCEPTED:
        q.refused_in_a_row += 1
        return 0.0, False
    q.refused_in_a_row = 0
    dt, afresh = c.dt, True
    if q.started:
        afresh = False
        dt = (stamp - q.stamp) * 1e-9
        if dt > 1.5 * c.dt:
            q.gaps += 1
            q.missed += int(dt * c.sample_rate + 0.5) - 1
        if dt > c.gap_reset:
            q.restarts += 1
            dt, afresh = c.dt, True
    q.started = True
    q.stamp = stamp
    return dt, afresh
