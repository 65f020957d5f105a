# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The loops over rows {valve, stamp, seven signals} of many valves, compiled.

Compiled code has no bounds check: `Bank.take` checks the rows first.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.approximator import step as approximator
from damadics_fd.core.approximator.state import Estimate, State
from damadics_fd.core.bank.ahead import fetch
from damadics_fd.core.decision import judge
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.jit import jit
from damadics_fd.core.quality import ACCEPTED, Quality
from damadics_fd.core.record import Array, Floats, Ints, Record, Rows
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.scada import kernel
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import State as Known

LATER = 255  # instead of a reason: the valve is still learned in mode scada, which is not compiled
Reasons = NDArray[np.uint8]


class LastRefused(Record):
    """Remember the sample of a valve that was refused last."""

    reason: int  # ACCEPTED where there was none
    stamp: int
    before: int  # stamp of the last accepted sample before it
    values: Annotated[Floats, len(SIGNALS)]


@jit
def note(
    r: LastRefused,
    q: Quality,
    reason: int,
    stamp: int,
    cv: float,
    x1: float,
    p1: float,
    p2: float,
    t1: float,
    flow: float,
    ps: float,
) -> None:
    """
    Remember a refused sample.

    :param r: written.
    :param q: quality record of its valve.
    :param reason: why.
    :param stamp: of the sample [ns]; its signals follow.
    """
    r.reason = reason
    r.stamp = stamp
    r.before = q.stamp
    r.values[0] = cv
    r.values[1] = x1
    r.values[2] = p1
    r.values[3] = p2
    r.values[4] = t1
    r.values[5] = flow
    r.values[6] = ps


@jit
def decide(
    ds: judge.State, g: Known, e: Estimate, d: Decision, c: Settings, gc: SignatureSettings
) -> bool:
    """
    Judge the latest estimate of one valve. It takes records: arrays would be counted in each row.

    :param ds: state of the detector.
    :param g: state of the signature.
    :param e: latest estimate.
    :param d: latest decision, written.
    :param c: settings.
    :param gc: settings of the signature.
    :return: True where a transition happened or the flag shows something else.
    """
    fault, state, level = d.fault, d.state, d.level
    judge.step(ds, c, g, gc, e, d)
    judge.report(ds, g, gc, e, d)
    return bool(d.transitions != 0 or d.fault != fault or d.state != state or d.level != level)


@jit
def take_approximator(
    where: Ints,
    q: Rows[Quality],
    r: Rows[LastRefused],
    s: Rows[State],
    ds: Rows[judge.State],
    g: Array,
    e: Rows[Estimate],
    d: Array,
    which: Ints,
    c: Rows[Settings],
    gc: Array,
    valve: Ints,
    reason: Reasons,
    changed: Ints,
    decisions: Array,
    stamp: Ints,
    cv: Floats,
    x1: Floats,
    p1: Floats,
    p2: Floats,
    t1: Floats,
    flow: Floats,
    ps: Floats,
) -> int:
    """
    Take rows of valves in the modes paper and monitor.

    :param where: the records of a valve, as `ahead.places` returns it.
    :param q: quality states; these and the following hold a record per valve.
    :param r: the samples refused last.
    :param s: estimator states.
    :param ds: detector states.
    :param g: states of the signature.
    :param e: latest estimates.
    :param d: latest decisions.
    :param which: the valve's place among the settings.
    :param c: settings.
    :param gc: settings of signatures.
    :param valve: of each row.
    :param reason: written: ACCEPTED or the reason of refusal.
    :param changed: written: rows at which a transition happened or a flag changed.
    :param decisions: written: the decisions at these rows.
    :param stamp: of each row; the following are columns of the rows too.
    :return: how many such rows.
    """
    count = 0
    for i in range(len(valve)):
        v = valve[i]
        if i + 1 < len(valve):
            fetch(where, valve[i + 1])
        w = which[v]
        reason[i] = approximator.step(
            q[v],
            s[v],
            c[w],
            e[v],
            stamp[i],
            cv[i],
            x1[i],
            p1[i],
            p2[i],
            t1[i],
            flow[i],
            ps[i],
        )
        if reason[i] != ACCEPTED:
            note(
                r[v], q[v], reason[i], stamp[i], cv[i], x1[i], p1[i], p2[i], t1[i], flow[i], ps[i]
            )
        elif decide(ds[v], g[v], e[v], d[v], c[w], gc[w]):
            changed[count] = i
            decisions[count] = d[v]
            count += 1
    return count


@jit
def take_control_room(
    q: Rows[Quality],
    r: Rows[LastRefused],
    a: Rows[kernel.Shown],
    states: Array,
    settings: Array,
    reference: Array,
    learned: NDArray[np.bool_],
    blank: Array,
    ds: Rows[judge.State],
    g: Array,
    e: Rows[Estimate],
    d: Array,
    which: Ints,
    c: Rows[Settings],
    gc: Array,
    valve: Ints,
    reason: Reasons,
    changed: Ints,
    decisions: Array,
    stamp: Ints,
    cv: Floats,
    x1: Floats,
    p1: Floats,
    p2: Floats,
    t1: Floats,
    flow: Floats,
    ps: Floats,
) -> int:
    """
    Take rows of valves in mode scada; those of valves that are still learned stay for later.

    :param q: as for `take_approximator`, like all that is not named here.
    :param a: what the estimates show.
    :param states: states of models and tests.
    :param settings: their settings.
    :param reference: what was learned.
    :param learned: of which valves.
    :param blank: an empty state of models and tests, in an array of length 1.
    :return: rows at which a transition happened or a flag changed.
    """
    count = 0
    row = np.empty(7)
    for i in range(len(valve)):
        v = valve[i]
        if not learned[v]:
            reason[i] = LATER
            continue
        w = which[v]
        reason[i] = kernel.take(
            q[v],
            a[v],
            states,
            v,
            c[w],
            settings[w : w + 1],
            reference,
            blank,
            row,
            e[v],
            stamp[i],
            cv[i],
            x1[i],
            p1[i],
            p2[i],
            t1[i],
            flow[i],
            ps[i],
        )
        if reason[i] != ACCEPTED:
            note(
                r[v], q[v], reason[i], stamp[i], cv[i], x1[i], p1[i], p2[i], t1[i], flow[i], ps[i]
            )
        elif decide(ds[v], g[v], e[v], d[v], c[w], gc[w]):
            changed[count] = i
            decisions[count] = d[v]
            count += 1
    return count
