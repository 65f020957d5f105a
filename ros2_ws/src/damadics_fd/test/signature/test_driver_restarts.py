# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""An alarm is open, the driver is gone for two minutes, and comes back."""

from pathlib import Path

import numpy as np
import pytest
from damadics_fd.bag import read_columns
from damadics_fd.core.decision.alarm import CHANGED, CLEARED, RAISED
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings

from ..bag.bag_support import needs_messages

BAGS = Path(__file__).parents[5] / 'bags'
AWAY = 120 * 10**9  # ns
OPEN = 71.875  # s, when the friction of the recording raises the alarm
pytestmark = needs_messages


def part(columns: dict, begin: float, end: float) -> dict:
    t = (columns['stamp'] - columns['stamp'][0]) * 1e-9
    kept = (t >= begin) & (t < end)
    return {name: column[kept] for name, column in columns.items()}


def after_the_break(*later: dict):
    """Return the events of a valve whose friction has grown, and what comes after two minutes."""
    parts = [read_columns(BAGS / 'lugre_friction.mcap')]
    pause = AWAY
    for columns in later:
        moved = parts[-1]['stamp'][-1] + pause - columns['stamp'][0]
        parts.append({**columns, 'stamp': columns['stamp'] + moved})
        pause = 5 * 10**6
    joined = {name: np.concatenate([each[name] for each in parts]) for name in parts[0]}
    result = run(joined, Settings.for_mode('monitor'))
    zero = joined['stamp'][0]
    return [((event.stamp - zero) * 1e-9, event) for event in result.events]


@pytest.mark.parametrize('begin', [0.0, 30.0])
def test_a_valve_that_was_repaired_meanwhile_clears_and_gets_no_wrong_cause(begin):
    nominal = part(read_columns(BAGS / 'lugre_nominal.mcap'), begin, 60.0)
    events = after_the_break(nominal)
    assert [(t, e.transition) for t, e in events][0] == (pytest.approx(OPEN, abs=0.1), RAISED)
    later = [event for t, event in events if t > 195.0]
    assert CLEARED in [event.transition for event in later]
    assert not [event for event in later if event.transition == RAISED], 'one alarm, not two'
    assert {event.cause for event in later} <= {'', 'undetermined', 'unconfirmed'}


def test_a_fault_that_is_still_there_is_named_from_what_came_after_the_break():
    faulty = part(read_columns(BAGS / 'lugre_friction.mcap'), 70.5, 75.0)
    events = after_the_break(*[faulty] * 8)
    later = [event for t, event in events if t > 195.0]
    assert [event.transition for event in later] == [CHANGED]
    assert later[0].cause == 'friction_up'
