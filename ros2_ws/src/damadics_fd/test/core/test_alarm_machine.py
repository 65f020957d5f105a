# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""No sequence of samples and requests breaks the alarm."""

import json

import hypothesis.strategies as st
import pytest
from damadics_fd.core.decision import alarm
from damadics_fd.core.decision.alarm import (
    ACKNOWLEDGED,
    CHANGED,
    CLEARED,
    NEAR_MISS,
    RAISED,
    RESET,
    SHELVED,
    STATE_LATCHED,
    UNSHELVED,
    Alarm,
)
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.modes import PHASE_HOLD, PHASE_LEARN_PHI, PHASE_MONITOR
from damadics_fd.core.settings import Settings
from hypothesis import given
from hypothesis import settings as profile
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from .residuals import Valve


class AlarmMachine(RuleBasedStateMachine):
    """AM-9: no sequence of samples and requests breaks the alarm."""

    def __init__(self):
        super().__init__()
        self.valve = Valve(on_delay=0.01, off_delay=0.1)
        self.valve.feed(0.1)
        self.raised = self.resumed = self.cleared = 0
        self.active_before = False
        self.reset_allowed = False

    def note(self, events):
        for event in events:
            if event.transition == RAISED:
                assert not self.active_before
                self.raised += 1
                self.active_before = True
            elif event.transition == CHANGED and self.valve.detector.state['active'][0]:
                self.resumed += not self.active_before
                self.active_before = True
            elif event.transition == CLEARED:
                assert self.active_before
                self.cleared += 1
                self.active_before = False
            elif event.transition == RESET:
                assert not self.active_before  # never reset while active
            assert event.transition in (
                RAISED,
                CLEARED,
                ACKNOWLEDGED,
                RESET,
                SHELVED,
                UNSHELVED,
                NEAR_MISS,
                CHANGED,
            )

    @rule(
        ratio=st.sampled_from([0.0, 0.9, 1.1, 2.0, 9.0]),
        n=st.integers(1, 40),
        phase=st.sampled_from([PHASE_MONITOR] * 4 + [PHASE_HOLD, PHASE_LEARN_PHI]),
    )
    def sample(self, ratio, n, phase):
        for _ in range(n):
            was = self.valve.detector.decision
            decision = self.valve.feed(ratio, phase=phase)
            self.note(decision.events)
            if was.fault and not decision.fault:
                raise AssertionError('an alarm went without reset')
            if any(e.transition == CLEARED for e in decision.events):
                assert ratio < 1.0, 'cleared while over the threshold'

    @rule()
    def acknowledge(self):
        outcome = self.valve.detector.acknowledge()
        assert outcome.done == (
            self.valve.detector.state['active'][0] or self.valve.detector.state['latched'][0]
        )
        self.note(outcome.events)

    @rule()
    def reset(self):
        active = self.active_before
        outcome = self.valve.detector.reset_alarm()
        assert not (active and outcome.done)
        self.note(outcome.events)
        if outcome.done and self.valve.detector.state['shelved_until'][0] == 0:
            assert self.valve.detector.decision.state != STATE_LATCHED

    @rule(seconds=st.sampled_from([0.05, 1.0, -1.0]))
    def shelve(self, seconds):
        assert self.valve.detector.shelve(seconds).done == (seconds > 0)

    @rule()
    def unshelve(self):
        self.valve.detector.unshelve()

    @rule()
    def restart(self):
        saved = json.loads(json.dumps(self.valve.detector.save()))
        self.valve.detector = Detector(self.valve.settings)
        self.valve.detector.load(saved)
        assert self.valve.detector.save() == saved

    @rule(back=st.integers(1, 10**9))
    def set_clock_back(self, back):
        self.valve.stamp = max(self.valve.stamp - back, 0)

    @invariant()
    def consistent(self):
        state = self.valve.detector.state[0]
        decision = self.valve.detector.decision
        assert bool(state.active) == self.active_before
        assert int(state.occurrence) == self.raised
        assert self.raised + self.resumed == self.cleared + self.active_before
        shelved = state.shelved_until > 0
        assert decision.fault == ((bool(state.active) or bool(state.latched)) and not shelved)
        assert not state.active or state.latched
        assert decision.level in (0, 1, 2, 3, 4)
        if decision.fault:
            assert decision.level in (1, 2, 4)


AlarmMachine.TestCase.settings = profile(max_examples=200, stateful_step_count=30, deadline=None)
TestAlarmMachine = AlarmMachine.TestCase


RESTING = st.fixed_dictionaries(
    {
        'stamp': st.integers(-1, 9),
        'latched': st.booleans(),
        'flag': st.booleans(),
        'since': st.integers(0, 9),
        'pending': st.integers(-1, 9),
        'last_decision': st.integers(0, 9),
        'near_misses': st.integers(0, 3),
    }
)


def rows(values):
    record = Alarm.rows()
    alarm.begin(record[0])
    for name, value in values.items():
        record[name] = value
    return record


@profile(deadline=None)  # the first one compiles
@given(RESTING, st.integers(0, 9), *[st.booleans()] * 4)
def test_what_is_passed_by_is_what_a_step_would_have_done(
    values, later, armed, busy, moving, present
):
    """The short way of nearly every sample has the bits of the long one."""
    settings = Settings.for_mode('monitor').record()
    short, long = rows(values), rows(values)
    stamp = values['stamp'] + later
    assert alarm.pass_by(short[0], stamp, False, 0)
    step = alarm.step(long[0], settings[0], stamp, armed, False, busy, 0, 0.5, moving, present)
    assert step == 0
    assert short.tobytes() == long.tobytes()


@pytest.mark.parametrize(
    ('values', 'stamp', 'exceed', 'level'),
    [
        ({}, 5, True, 0),
        ({}, 5, False, 1),
        ({'active': True}, 5, False, 0),
        ({'excursion': 3}, 5, False, 0),
        ({'shelved_until': 9}, 5, False, 0),
        ({'stamp': 6}, 5, False, 0),
    ],
)
def test_what_may_change_the_alarm_is_not_passed_by(values, stamp, exceed, level):
    record = rows(values)
    assert not alarm.pass_by(record[0], stamp, exceed, level)
    assert record.tobytes() == rows(values).tobytes()
