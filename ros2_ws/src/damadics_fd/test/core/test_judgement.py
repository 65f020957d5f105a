# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What mode scada takes a fault for, in the events of the detector, in whatever order it comes."""

from dataclasses import replace

import pytest
from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.alarm import ACKNOWLEDGED, CHANGED, RAISED
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.judgement import Judgement, LiveJudgement
from damadics_fd.core.modes import PHASE_MONITOR
from damadics_fd.core.settings import Settings
from damadics_fd.core.stamps import SECOND

AT = 1000 * SECOND
FIRST = Judgement(AT, 7, 'r2/1.5', AT - 5 * SECOND, 'control-room test')
NAMED = replace(
    FIRST,
    stamp=AT + 10 * SECOND,
    candidates=('f19', 'f2'),
    confidence=(0.7, 0.3),
    strength=0.23,
    text='f19 flow sensor or f2 plug; flow 25 % too low',
)


def estimate(stamp: int, ratio: float) -> Estimate:
    values = dict.fromkeys(Estimate.names(), 0.0)
    values |= {'stamp': stamp, 'xi2': ratio, 'x1': 0.5, 'x1_hat': 0.5, 'phase': PHASE_MONITOR}
    return Estimate(**values)


@pytest.fixture
def detector():
    detector = Detector(Settings.for_mode('scada', latch=True))
    detector.update(estimate(AT - SECOND, 0.1))
    return detector


def test_the_alarm_carries_test_and_onset_and_the_cause_follows(detector):
    live = LiveJudgement(detector)
    assert live.tell((), FIRST) == []  # comes before the estimate that raises the alarm
    (raised,) = live.tell(detector.update(estimate(AT, 1.2)).events)
    assert (raised.transition, raised.test) == (RAISED, 'r2/1.5')
    assert raised.onset == detector.decision.onset == FIRST.onset
    assert raised.duration == 5.0
    assert 'control-room test r2/1.5 at 1.20 x its limit' in raised.text
    (named,) = live.tell((), NAMED)
    assert (named.transition, named.occurrence, named.stamp) == (CHANGED, 1, NAMED.stamp)
    assert (named.cause, named.candidates) == ('f19 or f2', ('f19', 'f2'))
    assert (named.confidence, named.strength) == (0.7, 0.23)
    assert '25 % too low' in named.text
    assert live.tell((), replace(NAMED)) == []  # what DDS brings once more
    detector.update(estimate(AT + 20 * SECOND, 0.1))
    (back,) = live.tell(detector.update(estimate(AT + 30 * SECOND, 1.3)).events)
    assert (back.transition, back.cause) == (CHANGED, 'f19 or f2')  # and is not forgotten
    (seen,) = live.tell(detector.acknowledge().events)
    assert (seen.transition, seen.cause) == (ACKNOWLEDGED, '')


def test_a_judgement_that_comes_late_still_brings_the_cause(detector):
    live = LiveJudgement(detector)
    (raised,) = live.tell(detector.update(estimate(AT, 1.2)).events)
    assert (raised.test, raised.onset) == ('', AT)
    assert live.tell((), FIRST) == []
    assert detector.decision.onset == FIRST.onset
    (named,) = live.tell((), NAMED)
    assert (named.test, named.cause, named.onset) == ('r2/1.5', 'f19 or f2', FIRST.onset)


def test_an_alarm_that_waits_for_its_delay_is_raised_with_its_cause():
    detector = Detector(Settings.for_mode('scada', on_delay=12.0))
    live = LiveJudgement(detector)
    for second in range(12):
        assert not live.tell(detector.update(estimate(AT + second * SECOND, 1.2)).events, FIRST)
    assert live.tell((), NAMED) == []
    (raised,) = live.tell(detector.update(estimate(AT + 12 * SECOND, 1.2)).events)
    assert (raised.transition, raised.cause) == (RAISED, 'f19 or f2')
    assert raised.text.endswith(NAMED.text)


def test_the_judgement_of_an_earlier_fault_is_none_of_this_one(detector):
    live = LiveJudgement(detector)
    live.tell((), replace(NAMED, stamp=AT - 2 * SECOND))
    (raised,) = live.tell(detector.update(estimate(AT, 1.2)).events)
    assert (raised.test, raised.cause) == ('', '')
    assert detector.decision.onset == AT
