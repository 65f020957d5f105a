# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Decision and alarm life: the AM rows of the reliability cases."""

import json
import math

import pytest
from damadics_fd.core.decision import alarm, events, judge
from damadics_fd.core.decision.alarm import (
    ACKNOWLEDGED,
    SHELVED,
    STATE_ALARM,
    STATE_HEALTHY,
    STATE_LATCHED,
    STATE_LEARNING,
    STATE_NOT_MONITORING,
    STATE_SHELVED,
)
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.modes import PHASE_HOLD, PHASE_LEARN_PHI

from .residuals import TICK, Valve


@pytest.mark.plain
def test_a_single_spike_is_a_near_miss():  # IN-3, AM-2
    valve = Valve()
    valve.feed(0.1, 1.0)
    valve.feed(1e9)
    decision = valve.feed(0.1, 1.0)
    assert not decision.fault
    assert valve.names() == ['near_miss']
    assert valve.detector.statistics == {'occurrences': 0, 'near_misses': 1, 'chatter': 0}


@pytest.mark.plain
def test_a_residual_between_the_threshold_and_a_raised_level_is_one_near_miss():
    """Where commission raises the level, no vote remembers a residual that stays below it."""
    valve = Valve(level_maintenance=1.7, level_specification=3.4, level_failure=6.8)
    valve.feed(0.1, 1.0)
    valve.feed(1.3, 2.0)
    valve.feed(0.1, 1.0)
    assert valve.names() == ['near_miss']


@pytest.mark.plain
def test_m_of_n_counts_samples_that_are_not_in_a_row():
    valve = Valve(decide_m=3, decide_n=5)
    for ratio in (1.2, 0.1, 1.2, 0.1):
        assert not valve.feed(ratio).fault
    assert valve.feed(1.2).fault
    assert valve.names() == ['raised']
    assert valve.events[0].onset == TICK


@pytest.mark.plain
def test_decision_shorter_than_the_on_delay_is_a_near_miss():  # AM-2
    valve = Valve(on_delay=0.5)
    valve.feed(1.5, 0.4)
    assert not valve.feed(0.1, 1.0).fault
    assert valve.names() == ['near_miss']
    decision = valve.feed(1.5, 0.6)
    assert decision.fault
    assert decision.since - decision.onset == pytest.approx(0.5e9, abs=2 * TICK)


def test_an_alarm_over_no_threshold_names_a_ratio_that_is_one_or_none():
    assert events.CAPPED == judge.LARGE
    plain = {name: 0 for name in Decision.names()} | {
        'stamp': 9, 'occurrence': 1, 'residual': 8.6e-5, 'threshold': 7.6e-8, 'ratio': 1137.27,
        'peak': judge.LARGE, 'transitions': 1 << alarm.RAISED,
    }  # fmt: skip
    (raised,) = Decision(**plain).events
    assert raised.ratio == 1137.27 and '1137.27 x threshold' in raised.text
    (raised,) = Decision(**plain | {'threshold': 0.0, 'ratio': judge.LARGE}).events
    assert (
        math.isnan(raised.ratio) and 'residual beyond threshold (8.6e-05 / 0 1/s)' in raised.text
    )
    (cleared,) = Decision(**plain | {'ratio': 0.2, 'transitions': 1 << alarm.CLEARED}).events
    assert math.isnan(cleared.ratio) and '00000' not in cleared.text
    (usual,) = Decision(**plain | {'ratio': 0.2, 'peak': 0.7}).events
    assert usual.ratio == 0.7


def test_chattering_condition_is_one_alarm():  # AM-1
    valve = Valve(latch=False)
    for _ in range(30):
        valve.feed(1.5, 0.5)
        valve.feed(0.1, 0.5)
    assert valve.names() == ['raised']
    without = Valve(latch=False, off_delay=0.0)
    for _ in range(3):
        without.feed(1.5, 0.5)
        without.feed(0.1, 0.5)
    assert without.names() == ['raised', 'cleared'] * 3
    assert without.detector.statistics['chatter'] == 1


@pytest.mark.plain
def test_returned_alarm_stays_until_a_person_has_seen_it():  # AM-3, AM-4, AM-5
    valve = Valve()
    assert valve.feed(1.2, 1.0).state == STATE_ALARM
    refused = valve.detector.reset_alarm()
    assert not refused.done
    assert 'still active' in refused.text
    decision = valve.feed(0.1, 10.0)
    assert (decision.fault, decision.state, decision.acknowledged) == (True, STATE_LATCHED, False)
    assert valve.detector.acknowledge().done
    assert valve.detector.acknowledge().events == ()  # AM-8: twice is no error
    assert not valve.detector.acknowledge(7).done
    assert valve.detector.reset_alarm().done
    assert valve.detector.decision.state == STATE_HEALTHY
    assert not valve.detector.reset_alarm().done
    assert not valve.feed(0.1).fault


@pytest.mark.plain
def test_new_evidence_of_a_latched_alarm_is_no_new_alarm():  # AM-4, AL-7
    valve = Valve()
    valve.feed(1.2, 1.0)
    first = valve.detector.acknowledge()
    assert [event.transition for event in first.events] == [ACKNOWLEDGED]
    assert valve.feed(1.3, 1.0).acknowledged
    valve.feed(0.1, 6.0)
    decision = valve.feed(1.2, 1.0)
    assert decision.occurrence == 1
    assert decision.acknowledged
    assert valve.names() == ['raised', 'cleared', 'changed']
    valve.feed(0.1, 6.0)
    assert valve.detector.reset_alarm().done
    decision = valve.feed(1.2, 1.0)
    assert decision.occurrence == 2  # after the reset it is another one
    assert not decision.acknowledged
    assert valve.events[-1].onset == valve.stamp - 200 * TICK + TICK


def test_a_resting_stem_ends_no_alarm():
    valve = Valve(latch=False)
    valve.feed(1.2, 1.0)
    assert valve.feed(0.1, 600.0, stroke=0.0).fault
    assert valve.feed(0.1, 2.0).fault  # to it come the 2 s after the last motion before the rest
    assert not valve.feed(0.1, 2.0).fault
    assert valve.names() == ['raised', 'cleared']


@pytest.mark.plain
def test_levels_rise_with_the_ratio():
    valve = Valve()
    assert valve.feed(1.1, 0.1).level == alarm.MAINTENANCE_REQUIRED
    assert valve.feed(1.6, 0.1).level == alarm.OUT_OF_SPECIFICATION
    assert valve.feed(2.6, 0.1).level == alarm.FAILURE
    assert valve.feed(1.1, 0.1).level == alarm.FAILURE  # the worst of this fault
    assert valve.names() == ['raised', 'changed', 'changed']
    assert valve.events[-1].ratio == pytest.approx(2.6)
    assert 'failure' in valve.events[-1].text


def test_shelf_masks_records_and_ends_by_itself():  # AM-6
    valve = Valve()
    assert [e.transition for e in valve.detector.shelve(10.0).events] == [SHELVED]
    decision = valve.feed(2.0, 5.0)
    assert (decision.fault, decision.state) == (False, STATE_SHELVED)
    assert decision.level == alarm.FUNCTION_CHECK
    assert decision.occurrence == 1
    decision = valve.feed(2.0, 6.0)
    assert (decision.fault, decision.state) == (True, STATE_ALARM)
    assert valve.names() == ['raised', 'unshelved']
    assert not valve.detector.shelve(math.nan).done
    assert not valve.detector.shelve(-1.0).done
    assert not valve.detector.shelve(5e-324).done
    assert not valve.detector.unshelve().done


@pytest.mark.plain
def test_alarm_survives_a_restart():  # AM-7
    valve = Valve()
    valve.feed(1.7, 1.0)
    valve.feed(0.1, 6.0)
    saved = json.loads(json.dumps(valve.detector.save()))
    again = Valve()
    again.detector.load(saved)
    again.stamp = valve.stamp
    decision = again.detector.decision
    assert (decision.fault, decision.state, decision.acknowledged) == (True, STATE_LATCHED, False)
    assert again.feed(0.1) == valve.feed(0.1)


@pytest.mark.plain
@pytest.mark.parametrize(
    'damage',
    [
        lambda s: s.pop('active'),
        lambda s: s.update(active_since=1),
        lambda s: s.update(peak='x'),
        lambda s: s.update(peak=math.inf),
        lambda s: s.update(recent=[1, 2]),
        lambda s: s.update(occurrence=2**70),
        lambda s: s.update(occurrence=-1),
        lambda s: s.update(occurrence=2**32),
        lambda s: s.update(occurrence=1.5),
        lambda s: s.update(occurrence=0),
        lambda s: s.update(active='yes'),
        lambda s: s.update(active=1),
        lambda s: s.update(latched=False),
        lambda s: s.update(flag=False),
        lambda s: s.update(worst=4),
        lambda s: s.update(shelved_until=2**62),
        lambda s: s.update(shelved_until=31 * 86400 * 10**9),
        lambda s: s.update(since=2**63 - 1),
        lambda s: s.update(recent=[True] * 16),
        lambda s: s.update(told=9),
    ],
)
def test_damaged_alarm_state_is_refused_whole(damage):
    valve = Valve()
    valve.feed(1.7, 1.0)
    saved = valve.detector.save()
    damage(saved)
    before = valve.detector.save()
    with pytest.raises(ValueError):
        valve.detector.load(saved)
    assert valve.detector.save() == before


@pytest.mark.plain
def test_an_alarm_state_of_0_1_is_taken_up():
    valve = Valve()
    valve.feed(1.7, 1.0)
    saved = valve.detector.save()
    del saved['unknown']
    again = Valve()
    again.detector.load(saved)
    assert again.detector.decision.fault


@pytest.mark.plain
@pytest.mark.parametrize('confirm', ['acknowledge', 'reset_alarm'])
def test_a_lost_alarm_is_shown_as_lost_until_a_person_has_seen_it(confirm):
    valve = Valve()
    valve.detector.lose()
    assert valve.detector.decision.state == alarm.STATE_UNKNOWN
    decision = valve.feed(0.1, 1.0)
    assert (decision.state, decision.fault) == (alarm.STATE_UNKNOWN, False)
    assert decision.level == alarm.FUNCTION_CHECK
    again = Valve()
    again.detector.load(json.loads(json.dumps(valve.detector.save())))
    assert again.detector.decision.state == alarm.STATE_UNKNOWN, 'a restart is no confirmation'
    outcome = getattr(valve.detector, confirm)()
    assert outcome.done
    assert [event.name for event in outcome.events] == ['acknowledged']
    assert valve.feed(0.1, 0.1).state == alarm.STATE_HEALTHY
    assert not getattr(valve.detector, confirm)().done


@pytest.mark.plain
def test_a_new_alarm_is_shown_above_a_lost_one():
    valve = Valve()
    valve.detector.lose()
    assert valve.feed(1.7, 1.0).state == STATE_ALARM
    assert valve.detector.acknowledge().done
    assert valve.feed(0.1, 6.0).state == STATE_LATCHED
    assert valve.detector.reset_alarm().done
    assert valve.feed(0.1, 0.1).state == alarm.STATE_HEALTHY, 'a person was there'


def test_alarm_stays_while_the_detector_does_not_monitor():
    valve = Valve()
    assert valve.feed(0.1, phase=PHASE_LEARN_PHI).state == STATE_LEARNING
    assert valve.feed(9.9, 1.0, phase=PHASE_LEARN_PHI).state == STATE_LEARNING
    assert valve.feed(9.9, 1.0, phase=PHASE_HOLD).state == STATE_NOT_MONITORING
    valve.feed(1.5, 1.0)
    decision = valve.feed(0.1, 60.0, phase=PHASE_HOLD)
    assert (decision.fault, decision.state) == (True, STATE_ALARM)
    assert valve.feed(0.1, 6.0).state == STATE_LATCHED


def test_clock_set_back_keeps_the_alarm():  # TI-5
    valve = Valve()
    valve.feed(1.5, 20.0)
    valve.detector.shelve(3600.0)
    valve.stamp = 0
    decision = valve.feed(0.1, 4.0)
    assert decision.state == STATE_SHELVED
    valve.detector.unshelve()
    assert valve.feed(0.1, 0.1).state == STATE_ALARM  # the off delay started afresh
    assert valve.feed(0.1, 2.0).state == STATE_LATCHED


@pytest.mark.plain
def test_gates_at_the_stops():  # AL-4
    valve = Valve()
    assert not valve.feed(5.0, 0.1, x=0.005).fault  # pushed open by the stop
    assert not valve.feed(5.0, 0.1, x=0.975).fault
    assert not valve.feed(-5.0, 0.1, x=0.975).fault
    assert valve.feed(-5.0, 0.1, x=0.005).fault


def test_frozen_position_is_named():  # IN-4
    valve = Valve()
    valve.feed(0.1, 20.0, stroke=0.0)
    valve.feed(3.0, 0.1, stroke=0.0)
    assert 'position frozen for 20 s: stem or position sensor' in valve.events[0].text
