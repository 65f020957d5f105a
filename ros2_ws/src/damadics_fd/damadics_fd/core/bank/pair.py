# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Estimator and detector of one valve, each with its own settings, in one compiled call a sample.

Live, each message wakes a process whose code and data have left the cache: what little the two
compute then costs less than the way there. So they share one call and one record; what is out of
the ordinary is left to them.
"""

from functools import cache
from typing import Protocol

import numpy as np

from damadics_fd.core.approximator import step as approximator
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.approximator.state import Estimate, State
from damadics_fd.core.decision import judge
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.jit import jit
from damadics_fd.core.quality import ACCEPTED, Quality
from damadics_fd.core.record import Array, Row, Rows
from damadics_fd.core.sample import Sample
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import State as Known

ESTIMATED = -1  # not judged: the phase is another, or a decision has this stamp already
REFUSED = -2  # and below: less the reason
HAPPENED = 1  # bit: a transition of the alarm
SHOWN = 2  # bit: a flag shows something else
SIGNED = 4  # bit: state, family or cause of the signature is another
NAMES = ('q', 's', 'c', 'e', 'ds', 'dc', 'g', 'gc', 'd')


class Both(Protocol):
    """What the call sees of a valve."""

    q: Quality  # of the input
    s: State  # of the estimator
    c: Settings  # of the estimator
    e: Estimate  # the latest
    ds: judge.State  # of the detector
    dc: Settings  # of the detector
    g: Known  # of the signature
    gc: SignatureSettings
    d: Decision  # the latest


@jit
def take(
    both: Rows[Both],
    judged: Array,
    phase: int,
    last: int,
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
    Take one sample.

    :param both: of the valve, in an array of length 1.
    :param judged: the estimate that was judged, likewise, written.
    :param phase: of the sample before; an estimate of another is not judged.
    :param last: stamp of the latest decision [ns]; an estimate with it is not judged.
    :param stamp: of the sample [ns]; its signals follow.
    :return: bits of what is new, ESTIMATED, or REFUSED less the reason.
    """
    b = both[0]
    e = b.e
    reason = approximator.step(b.q, b.s, b.c, e, stamp, cv, x1, p1, p2, t1, flow, ps)
    if reason != ACCEPTED:
        return REFUSED - reason
    if e.phase != phase or stamp == last:
        return ESTIMATED
    known, now = b.g, b.d
    state, family, cause = known.state, known.family, known.cause
    fault, shown, level = now.fault, now.state, now.level
    judged[0] = e
    judge.step(b.ds, b.dc, known, b.gc, e, now)
    judge.report(b.ds, known, b.gc, e, now)
    news = HAPPENED if now.transitions != 0 else 0
    if now.fault != fault or now.state != shown or now.level != level:
        news |= SHOWN
    if known.state != state or known.family != family or known.cause != cause:
        news |= SIGNED
    return news


@cache  # one object for all valves: to tell that two are equal takes longer than the call
def _layout(kinds: tuple[np.dtype[np.void], ...]) -> np.dtype[np.void]:
    fields = list(zip(NAMES, kinds, strict=True))
    return np.dtype((Row, np.dtype(fields, align=True)))


class Pair:
    """
    Take the samples of a valve for its estimator and its detector.

    Both may be used as ever between two samples; their states stand in one record from now on.

    :param estimator: of mode paper or monitor.
    :param detector: that judges its estimates.
    """

    def __init__(self, estimator: Estimator, detector: Detector) -> None:
        quality, state, settings, estimate = estimator.arrays
        held, own, known, known_settings, judged, decision = detector.arrays
        parts = (quality, state, settings, estimate, held, own, known, known_settings, decision)
        both = np.zeros(1, _layout(tuple(part.dtype for part in parts)))
        for name, part in zip(NAMES, parts, strict=True):
            both[name] = part
        estimator.hold(both['q'], both['s'], both['e'])
        detector.hold(both['ds'], both['g'], judged, both['d'])
        self._both, self._judged = both, judged

    def take(self, sample: Sample, phase: int, last: int) -> int:
        """
        Estimate from a sample, and judge that.

        :param sample: the sample.
        :param phase: of the estimate before; one of another phase is not judged.
        :param last: stamp of the latest decision [ns]; an estimate with it is not judged.
        :return: 0 or bits of what is new with the decision; ESTIMATED where the estimate is for
            the detector to judge; REFUSED less the reason where the estimator has to note that.
        """
        news: int = take(self._both, self._judged, phase, last, *sample)
        return news


def warm_up() -> None:
    """Compile the call, or load it from the cache."""
    settings = Settings.for_mode('paper')
    Pair(Estimator(settings), Detector(settings)).take(Sample(1, 0.5, 0.5), -1, -1)
