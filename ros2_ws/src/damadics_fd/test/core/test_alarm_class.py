# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The NE 107 class of an alarm: the worse of residual and cause, the same wherever it is read."""

import math

import numpy as np
import pytest
from damadics_fd.causes import explain, load_causes
from damadics_fd.core.decision.alarm import (
    CHANGED,
    FAILURE,
    FUNCTION_CHECK,
    MAINTENANCE_REQUIRED,
    NE107,
    NORMAL,
    OUT_OF_SPECIFICATION,
    RAISED,
    SHELVED,
)
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.monitor import run
from damadics_fd.core.result import Result
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import CAUSES, STATE_ALARM

from .test_alarm import Valve

SPRING = CAUSES.index('spring_softer')
FRICTION = CAUSES.index('friction_up')


def alarmed(cause: int, value: float, classes=None, ratio: float = 1.2) -> Valve:
    """Return a valve with an alarm of the approximator and a named cause."""
    valve = Valve()
    valve.detector = Detector(valve.settings, classes or load_causes().classes)
    valve.feed(ratio, 0.1)
    valve.detector.signature.state['cause'] = cause
    valve.detector.signature.state['cause_value'] = value
    valve.feed(ratio)
    return valve


@pytest.mark.plain
def test_the_class_is_the_worse_of_residual_and_cause():
    valve = alarmed(SPRING, -0.3)
    assert valve.detector.decision.level == OUT_OF_SPECIFICATION
    assert [e.name for e in valve.events] == ['raised', 'changed']
    last = valve.events[-1]
    assert last.level == OUT_OF_SPECIFICATION and 'out of specification' in last.text
    assert explain(last, load_causes(), 'V').level == OUT_OF_SPECIFICATION
    severe = alarmed(FRICTION, 20.0, ratio=3.0)
    assert load_causes()['friction_up'].ne107 == MAINTENANCE_REQUIRED
    assert severe.detector.decision.level == FAILURE, 'the cause hid the size of the residual'


@pytest.mark.plain
def test_the_table_of_the_user_decides():
    classes = list(load_causes().classes)
    classes[FRICTION] = FAILURE
    assert alarmed(FRICTION, 0.5, classes).detector.decision.level == FAILURE
    without = alarmed(SPRING, -0.3, [NORMAL] * len(CAUSES))
    assert without.detector.decision.level == MAINTENANCE_REQUIRED
    with pytest.raises(ValueError, match='classes'):
        SignatureSettings(ne107=(0, 1))


def own_alarm(value: float, std: float) -> Valve:
    """Return a valve whose limit is 2 and whose signature has an alarm of its own."""
    valve = Valve(level_maintenance=2.0, level_specification=3.0, level_failure=4.0)
    valve.detector = Detector(valve.settings, load_causes().classes)
    valve.feed(0.1, 0.1)
    known = valve.detector.signature.state[0]
    known.own, known.cause, known.cause_value, known.cause_std = 1, FRICTION, value, std
    known.state, known.ne[:], known.r_ref = STATE_ALARM, 0.0, 1.0
    valve.feed(0.1, 0.1)
    return valve


@pytest.mark.plain
def test_a_residual_below_its_limit_does_not_make_a_small_change_matter():
    valve = own_alarm(0.1, 0.01)
    assert valve.feed(0.1).level == NORMAL
    assert valve.feed(1.9, 1.0).level == NORMAL, 'it is over the threshold, not over the limit'
    valve.feed(2.5)
    assert valve.feed(0.1).level == NORMAL, 'one sample decides nothing'
    assert valve.feed(2.5, 1.0).level == MAINTENANCE_REQUIRED
    assert valve.feed(0.1).level == MAINTENANCE_REQUIRED, 'what was decided stays'


@pytest.mark.plain
@pytest.mark.parametrize('cause', ['undetermined', 'unconfirmed'])
def test_an_own_alarm_is_normal_until_its_size_is_known(cause):
    valve = own_alarm(math.nan, math.nan)
    known = valve.detector.signature.state[0]
    known.cause, known.alarm_t = CAUSES.index(cause), 1
    known.now[:], known.now_t = (0.0, 0.0, 0.5), 1
    assert valve.feed(0.1, 90.0).level == NORMAL, 'what was known before is not of this alarm'
    known.now_t = 2
    assert valve.feed(0.1).level == MAINTENANCE_REQUIRED
    known.now[:] = (0.002, 0.0, 0.1)
    assert valve.feed(0.1).level == NORMAL


@pytest.mark.plain
def test_a_shelved_alarm_is_a_function_check_whatever_its_cause():
    valve = alarmed(SPRING, -0.3)
    (event,) = valve.detector.shelve(60.0).events
    assert event.transition == SHELVED
    assert explain(event, load_causes(), 'V').level == FUNCTION_CHECK
    assert valve.feed(1.2, 1.0).level == FUNCTION_CHECK
    valve.detector.unshelve()
    assert valve.feed(1.2).level == OUT_OF_SPECIFICATION


def slow_wear() -> Result:
    """Let friction fall by 60 % an hour under a threshold that the approximator never meets."""
    from damadics_plant import Fault, LuGreActuator, Scenario, simulate
    from damadics_plant.scenarios.sources import RandomSteps, Sine

    scenario = Scenario(
        'wear',
        2400.0,
        cv=RandomSteps(seed=6),
        faults=(Fault('f4', 0.6, 300.0, 3600.0, direction=-1),),
        p1=Sine(3.5e6, 175e3, 0.1),
        p2=Sine(2.6e6, 26e3, 0.32),
    )
    settings = Settings.for_mode('monitor', t_learn=60.0, rho_min=3.0)
    columns = simulate(scenario, 200.0, LuGreActuator(), noise='cv', seed=5)
    rng = np.random.default_rng(5)
    columns = dict(columns) | {
        'x1': columns['x1'] + 1.4e-3 * rng.standard_normal(len(columns['x1']))
    }
    return run(columns, settings, detector=Detector(settings, load_causes().classes))


def test_wear_is_told_again_when_it_matters_and_history_agrees_with_the_flag():
    result = slow_wear()
    raised = [e for e in result.events if e.transition == RAISED]
    assert len(raised) <= 2 and raised[-1].ratio < 1.0, 'the own alarm chatters'
    named = [e for e in result.events if e.cause == 'friction_down' and e.transition == CHANGED]
    small = next(e for e in named if e.level == NORMAL)
    assert abs(small.strength) < 0.3
    grown = next(e for e in named if e.stamp > small.stamp)
    assert grown.level == MAINTENANCE_REQUIRED
    assert abs(grown.strength) + 2.0 * grown.spread >= 0.3
    rows = result.decisions
    levels = dict(zip(rows['stamp'].tolist(), rows['level'].tolist(), strict=True))
    for event in result.events:
        assert event.level == levels[event.stamp], event.name
        if event.transition in (RAISED, CHANGED):
            assert NE107[event.level] in event.text
    flagged = rows[rows['fault']]
    told = {e.stamp for e in result.events}
    changed = flagged['stamp'][1:][flagged['level'][1:] != flagged['level'][:-1]]
    assert set(changed.tolist()) <= told, 'the class of the flag changed without an event'
    assert len(changed) < 8, 'the class chatters'
