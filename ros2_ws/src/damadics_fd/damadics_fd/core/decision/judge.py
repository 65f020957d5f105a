# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Judge estimates: threshold, alarm, signature and class; the hot loop of the detector."""

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.approximator.threshold import threshold
from damadics_fd.core.decision import alarm, vote
from damadics_fd.core.decision.alarm import Alarm
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.decision.vote import Votes
from damadics_fd.core.jit import jit, layer
from damadics_fd.core.modes import MONITOR, PHASE_HOLD, PHASE_PAPER
from damadics_fd.core.record import Array, Rows
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature import own_alarm
from damadics_fd.core.signature import step as signature_step
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import State as Known

LARGE = 1e9  # ratio to a threshold of zero
STIR = 0.01  # of the stroke: less is no motion of the stem
FRESH = 2_000_000_000  # ns after its last motion in which the stem counts as moving


class State(Votes, Alarm):
    """Remember what the detector knows of the valve: votes, alarm, motion."""

    place: float
    moved: int
    told: int
    decided: bool  # the approximator has a part in the present alarm


@layer
def step(s: State, c: Settings, g: Known, gc: SignatureSettings, e: Estimate, d: Decision) -> None:
    """
    Judge one estimate.

    :param s: state record.
    :param c: settings record.
    :param g: state record of the signature.
    :param gc: settings record of the signature.
    :param e: estimate record.
    :param d: decision record: what `report` does not tell is written.
    """
    armed = vote.armed(e.phase)
    residual = abs(e.xi2)
    rho = threshold(c, e.phi, e.alpha1)
    ratio = min(residual / rho, LARGE) if rho > 0.0 else LARGE
    # before anything moves both are 0 in paper mode: no evidence, though 0 >= 0
    exceed = armed and residual >= rho and residual > 0.0 and not vote.gated(c, e)
    level = 0
    if armed:
        level = vote.vote(s, c, exceed, ratio)
    else:
        vote.clear(s)
    cause = g.cause
    ready = e.phase not in (PHASE_PAPER, PHASE_HOLD)
    alarmed = s.active or s.latched
    if not signature_step.pass_by(g, gc, e.stamp, e.x1, e.ps, e.dp, ready, alarmed):
        signature_step.step(g, gc, e.stamp, e.x1, e.ps, e.dp, ready, alarmed)
    own = own_alarm.own_level(g, gc)
    exceed_any, worst = exceed or own > 0, max(level, own)
    d.transitions = 0
    if not alarm.pass_by(s, e.stamp, exceed_any, worst):
        d.transitions = alarm.step(
            s,
            c,
            e.stamp,
            armed or g.own != 0,
            exceed_any,
            s.count[0] > 0,
            worst,
            ratio,
            c.mode_code != MONITOR or e.stamp - s.moved < FRESH,
            own_alarm.persists(g, gc),
        )
    present = s.active or s.latched
    s.decided = present and (s.decided or level > 0)
    if g.cause != cause or not present:
        s.told = alarm.NORMAL
        if present:
            d.transitions |= 1 << alarm.CHANGED
    d.residual = residual
    d.threshold = rho
    d.ratio = ratio
    d.exceed = exceed
    if s.moved < 0 or e.stamp < s.moved or abs(e.x1 - s.place) > STIR:
        s.place = e.x1
        s.moved = e.stamp
    if s.flag:
        shown = class_of(s, g, gc, armed)
        if shown != s.told and d.transitions == 0:  # any other event tells the class as well
            d.transitions = 1 << alarm.CHANGED
        s.told = shown


@jit
def class_of(s: State, g: Known, gc: SignatureSettings, armed: bool) -> int:
    """
    Return the NAMUR NE 107 class that an alarm shows: the worse of residual and cause.

    :param s: state record.
    :param g: state record of the signature.
    :param gc: settings record of the signature.
    :param armed: decisions count.
    :return: a class; normal for a change too small for maintenance.
    """
    level: int = alarm.level_of(s, armed)
    if not s.decided and not own_alarm.material(g, gc, s.told > alarm.NORMAL):
        return alarm.NORMAL  # the approximator is content and the change is small
    return max(level, int(gc.ne107[g.cause]))


@jit
def report(s: State, g: Known, gc: SignatureSettings, e: Estimate, d: Decision) -> None:
    """
    Copy the state of the alarm into a decision.

    :param s: state record.
    :param g: state record of the signature.
    :param gc: settings record of the signature.
    :param e: estimate record.
    :param d: decision record, written.
    """
    armed = vote.armed(e.phase)
    d.stamp = e.stamp
    d.state = alarm.state_of(s, armed, e.phase)
    d.level = class_of(s, g, gc, armed) if s.flag else alarm.level_of(s, armed)
    d.fault = s.flag
    d.since = s.since
    d.onset = s.onset if s.active or s.latched else 0
    d.occurrence = s.occurrence
    d.acknowledged = s.acknowledged
    d.peak = s.peak
    d.still = (e.stamp - s.moved) * 1e-9
    d.cause = g.cause
    d.strength = g.cause_value
    d.spread = g.cause_std
    d.confidence = g.confidence


@jit
def judge(
    s: Rows[State],
    c: Rows[Settings],
    g: Rows[Known],
    gc: Rows[SignatureSettings],
    reason: NDArray[np.uint8],
    e: Array,
    d: Rows[Decision],
    judged: Array,
    latest: Array,
    keep: bool,
    first: int,
) -> tuple[int, int]:
    """
    Judge estimates one after the other: live one of them, in a recording all.

    :param s: detector state.
    :param c: settings.
    :param g: state of the signature.
    :param gc: settings of the signature.
    :param reason: 0 where there is an estimate.
    :param e: estimates.
    :param d: decisions, written where there is an estimate.
    :param judged: the last estimate, in an array of length 1, written.
    :param latest: the decision on it, likewise.
    :param keep: keep a row for each; otherwise only decisions with a transition, as many as
        there is room for.
    :param first: row to begin with.
    :return: the row after the last one, and the number of decisions with a transition.
    """
    kept = 0
    last = row = -1
    done = len(e)
    newest = done - 1
    while newest >= first and reason[newest] != 0:
        newest -= 1
    for i in range(first, len(e)):
        if reason[i] != 0:
            continue
        last, row = i, i if keep else kept
        step(s[0], c[0], g[0], gc[0], e[i], d[row])
        news = d[row].transitions != 0
        if keep or news or i == newest:  # the only call: a second one costs a tenth of the loop
            report(s[0], g[0], gc[0], e[i], d[row])
        if news:
            kept += 1
            if not keep and kept == len(d):
                done = i + 1
                break
    if last >= 0:
        judged[0] = e[last]
        latest[0] = d[row]
    return done, kept


@jit
def show(
    s: Rows[State],
    g: Rows[Known],
    gc: Rows[SignatureSettings],
    e: Rows[Estimate],
    d: Rows[Decision],
) -> None:
    """
    Copy the state of the alarm into a decision; `report` for arrays of length 1.

    :param s: detector state.
    :param g: state of the signature.
    :param gc: settings of the signature.
    :param e: the latest estimate.
    :param d: decision, written.
    """
    report(s[0], g[0], gc[0], e[0], d[0])
