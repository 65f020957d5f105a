# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the page tells a browser of a large fleet, without ROS and without a browser."""

import array
import json
import math

import page_site
import pytest
from damadics_dashboard.live.fleet import FleetReport
from damadics_dashboard.live.overview import Overview
from damadics_dashboard.live.valve import Valve
from damadics_dashboard.pages.fleet_page import Tiles
from damadics_dashboard.words.texts import texts
from damadics_dashboard.words.valve_words import alarm_words
from damadics_msgs.msg import FaultFlag, OperatorAction


@pytest.fixture
def fleet_of_200():
    """A fleet whose valves are healthy: its report, its valves, and a status of a moment [s]."""
    valves: dict[str, Valve] = {}
    report = FleetReport(lambda name: valves.setdefault(name, Valve(name)), '/fleet')
    layout, status = page_site.fleet_messages(200)
    report.take_layout(layout)

    def tell(moment: float) -> None:
        status.header.stamp.sec = 1_700_000_000 + int(moment)
        report.take_status(status, moment)
        for valve in valves.values():
            valve.second()

    return valves, status, tell


def test_of_a_large_fleet_only_tiles_with_other_words_travel(fleet_of_200):
    valves, status, tell = fleet_of_200
    overview = Overview(valves, lambda: 1_700_000_000 * 10**9 + int(now * 1e9))
    tiles = Tiles(overview, texts('en'))
    now = 10.0
    tell(now)
    overview.look(now)
    first = tiles.news()
    assert len(first['tiles']) == len(first['order']) == 200
    now = 11.0
    status.residual[7] = 0.62
    tell(now)
    overview.look(now)
    assert tiles.news() == {'tiles': {}}, 'residuals and ages travel as columns'
    columns = json.loads(overview.columns)
    place = first['order'].index('unit7/v0007')
    assert columns['shares'][place] == 62 and set(columns['ages']) == {0.2}
    status.state[7], status.level[7], status.fault[7] = FaultFlag.STATE_ALARM, 4, True
    now = 12.0
    tell(now)
    overview.look(now)
    assert [told['kind'] for told in tiles.news()['tiles'].values()] == ['F']
    assert json.loads(overview.columns)['shares'][place] == -1, 'its tile says more than a share'
    now = 20.0
    overview.look(now)
    assert {told['kind'] for told in tiles.news()['tiles'].values()} == {'off'}
    now = 21.0
    overview.look(now)
    assert tiles.news() == {'tiles': {}}, 'silence goes on'


def test_an_alarm_from_before_the_process_was_restarted_is_listed(fleet_of_200):
    valves, status, tell = fleet_of_200
    status.state[7], status.level[7], status.fault[7] = FaultFlag.STATE_ALARM, 4, True
    status.cause[7], status.residual[7], status.since[7] = (
        'friction_up',
        1.4,
        1_699_999_990 * 10**9,
    )
    tell(10.0)
    overview = Overview(valves, lambda: 1_700_000_010 * 10**9)
    overview.look(10.0)
    (alarm,) = overview.alarms.values()
    assert (alarm.occurrence, alarm.level, alarm.state) == (0, 4, 'active'), '0: the present one'
    words = alarm_words(valves['unit7/v0007'], alarm, texts('en'), name=False)
    assert 'riction' in words.headline and words.since
    assert 'Alarm no.' not in dict(words.cells) and dict(words.cells)['Largest residual']
    status.state[7], status.level[7], status.fault[7] = FaultFlag.STATE_HEALTHY, 0, False
    tell(11.0)
    overview.look(11.0)
    assert not overview.alarms


def test_the_learning_of_a_large_fleet_is_told_in_steps(fleet_of_200):
    valves, status, tell = fleet_of_200
    overview = Overview(valves, lambda: 1_700_000_000 * 10**9 + int(now * 1e9))
    tiles = Tiles(overview, texts('en'))
    told = 0
    for n in range(100):
        now = 10.0 + n
        status.state[:] = array.array('B', [FaultFlag.STATE_LEARNING] * 200)
        status.progress[:] = array.array('d', [n / 100] * 200)
        tell(now)
        overview.look(now)
        told += len(tiles.news()['tiles'])
    assert told == 20 * 200
    assert {tile['progress'] for tile in tiles._told.values()} == {0.95}


def test_a_status_with_odd_numbers_breaks_no_tile(fleet_of_200):
    valves, status, tell = fleet_of_200
    overview = Overview(valves, lambda: 1_700_000_001 * 10**9)
    status.age[3], status.ratio[4], status.residual[5] = math.nan, math.inf, math.nan
    status.threshold[6], status.age[8], status.valve[9] = 0.0, math.inf, 4_000_000_000
    tell(1.0)
    overview.look(1.1)
    news = Tiles(overview, texts('en')).message()
    told, columns = json.loads(f'[{news}]')
    assert len(told['tiles']) == 200
    kinds = {name: tile['kind'] for name, tile in told['tiles'].items() if tile['kind'] != 'ok'}
    assert kinds == {'unit9/v0009': 'off'}, 'nobody has told of the valve whose number is none'
    assert min(columns['shares']) == -1


def test_strokes_of_a_valve_of_a_fleet_are_booked_to_it_and_known_while_they_last(fleet_of_200):
    valves, *_ = fleet_of_200
    report = FleetReport(lambda name: valves[name], '/fleet', valves.get)
    booked = []
    for result in (
        '/unit7/v0007: 5 partial strokes were made',
        'done for 2 of 2 valves',
        '/elsewhere: 5 partial strokes were made',
    ):
        action = OperatorAction(action=OperatorAction.PARTIAL_STROKE, success=True, result=result)
        report.take_action(action, lambda name, told: booked.append((name, told.result)))
    assert booked == [('unit7/v0007', '5 partial strokes were made')]
    valve = valves['unit7/v0007']
    report.take_diagnostics({'Partial strokes under way': '/unit7/v0007, /elsewhere'})
    assert valve.stroking and not valves['unit8/v0008'].stroking
    report.take_diagnostics({'Valves': '200'})
    assert not valve.stroking
