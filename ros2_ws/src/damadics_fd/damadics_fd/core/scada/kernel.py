# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Samples through check, models and tests of a learned valve, one or a column; compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core import quality
from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.jit import jit
from damadics_fd.core.modes import PHASE_HOLD, PHASE_MONITOR
from damadics_fd.core.quality import Quality
from damadics_fd.core.record import Array, Floats, Ints, Record, Rows
from damadics_fd.core.scada.laws.actuator import F_RANGE, P_RANGE, T_RANGE, TPH_PER_KGS
from damadics_fd.core.scada.samples import usable
from damadics_fd.core.scada.step import accepts, step
from damadics_fd.core.settings import Settings


class Shown(Record):
    """Remember what the estimates show between two samples that the monitor takes."""

    residual: float
    ratio: float
    phase: int


@jit
def resume(states: Array, k: int, blank: Array) -> None:
    """
    Start the models of a valve afresh, for a clock that was set; keep the alarm.

    :param states: records of `MONITOR`.
    :param k: which of them.
    :param blank: one such record of zeros.
    """
    s = states[k]
    alarm, t_alarm, t_onset, test = s.alarm, s.t_alarm, s.t_onset, s.test
    occurrence, stood, recovery = s.occurrence, s.stood, s.recovery
    stands = s.stands.copy()
    states[k] = blank[0]
    s = states[k]
    s.occurrence = occurrence
    s.stood = stood
    s.recovery = recovery
    s.stands[:] = stands
    s.alarm = alarm
    s.t_alarm = t_alarm
    s.t_onset = t_onset
    s.test = test


@jit
def write(
    e: Estimate,
    a: Shown,
    c: Settings,
    stamp: int,
    cv: float,
    x1: float,
    p1: float,
    p2: float,
    ps: float,
    progress: float,
) -> None:
    """
    Write an estimate: xi1 = r1, xi2 = largest statistic / limit, signed as r1.

    :param e: estimate, written.
    :param a: what is shown.
    :param c: settings.
    :param stamp: the sample's stamp [ns]; its signals follow.
    :param progress: share of the learning that is done.
    """
    e.stamp = stamp
    e.x2 = math.nan
    e.x1_hat = x1 + c.spring_origin - a.residual
    e.x2_hat = math.nan
    e.xi1 = a.residual
    e.xi2 = math.copysign(a.ratio, a.residual)
    e.phi = 0.0
    e.alpha1 = 0.0
    e.alpha4 = 0.0
    e.alpha5 = 0.0
    e.x1 = x1
    e.u = cv
    e.ps = ps
    e.dp = p1 - p2
    e.progress = progress
    e.phase = a.phase


@jit
def take(
    q: Quality,
    a: Shown,
    states: Array,
    k: int,
    c: Settings,
    settings: Array,
    reference: Array,
    blank: Array,
    row: Floats,
    e: Estimate,
    stamp: int,
    cv: float,
    x1: float,
    p1: float,
    p2: float,
    t1: float,
    flow: float,
    ps: float,
) -> int:
    """
    Take one sample of a valve that was learned.

    :param q: quality record.
    :param a: what is shown.
    :param states: records of `MONITOR`, one per valve.
    :param k: which of them, and which of the references.
    :param c: settings record.
    :param settings: record of the monitor's own settings, in an array of length 1.
    :param reference: records of `REFERENCE`.
    :param blank: a record of `MonitorState` of zeros, in an array of length 1.
    :param row: work space, shape (7,).
    :param e: estimate, written where the sample is accepted.
    :param stamp: the sample's stamp [ns]; its signals follow.
    :return: quality.ACCEPTED or the reason of refusal.
    """
    reason = quality.check_values(c, cv, x1, p1, p2, t1, flow, ps)
    if reason == quality.ACCEPTED:
        reason = quality.check_stamp(q, c, stamp)
    restarted = not q.started
    quality.admit(q, c, stamp, reason)
    if reason != quality.ACCEPTED:
        return reason
    if restarted:
        resume(states, k, blank)
    s = states[k]
    row[0] = stamp * 1e-9
    row[1] = cv
    row[2] = x1
    row[3] = p1 / P_RANGE
    row[4] = p2 / P_RANGE
    row[5] = t1 / T_RANGE
    row[6] = flow * (TPH_PER_KGS / F_RANGE)
    if usable(row, s) and accepts(s, settings[0], row[0]):
        step(s, settings[0], reference[k], row[0], row[1], row[2], row[3], row[4], row[5], row[6])
        a.residual = 0.0 if math.isnan(s.residual[0]) else s.residual[0]
        a.ratio = s.ratio
        a.phase = PHASE_MONITOR if s.t >= s.t_test else PHASE_HOLD
    write(e, a, c, stamp, cv, x1, p1, p2, ps, 1.0)
    return reason


@jit
def take_column(
    q: Rows[Quality],
    a: Rows[Shown],
    states: Array,
    c: Rows[Settings],
    settings: Array,
    reference: Array,
    blank: Array,
    reason: NDArray[np.uint8],
    e: Rows[Estimate],
    stamp: Ints,
    cv: Floats,
    x1: Floats,
    p1: Floats,
    p2: Floats,
    t1: Floats,
    flow: Floats,
    ps: Floats,
) -> None:
    """
    Take a column of samples of a valve that was learned.

    :param q: these and the following are as for `take`, in arrays of length 1.
    :param reason: written: ACCEPTED or the reason of refusal.
    :param e: estimates, written; rows of refused samples stay as they are.
    :param stamp: columns of the samples.
    """
    row = np.empty(7)
    for i in range(len(stamp)):
        reason[i] = take(
            q[0],
            a[0],
            states,
            0,
            c[0],
            settings,
            reference,
            blank,
            row,
            e[i],
            stamp[i],
            cv[i],
            x1[i],
            p1[i],
            p2[i],
            t1[i],
            flow[i],
            ps[i],
        )
