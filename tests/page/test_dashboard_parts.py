# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page without a browser: traces, honest decimation, words, access, history."""

import math
import re

import numpy as np
import pytest
from alarm_events import event
from damadics_dashboard.live.fleet import FleetReport, shared
from damadics_dashboard.live.raw import Batch
from damadics_dashboard.live.record import ACTIONS
from damadics_dashboard.live.traces import NANO, Trace, envelope
from damadics_dashboard.live.valve import Valve
from damadics_dashboard.pages.fleet_page import tile
from damadics_dashboard.pages.playback import play, settings_in_file
from damadics_dashboard.store.export import cell
from damadics_dashboard.words.answers import answer_words
from damadics_dashboard.words.templates import TEMPLATES, render
from damadics_dashboard.words.texts import texts
from damadics_dashboard.words.valve_words import alarm_words, history_rows
from damadics_fd.core.settings import SettingsError
from damadics_fd.store.access import Access, Grant, Role
from damadics_msgs.msg import (
    FaultEvent,
    FaultFlag,
    FleetLayout,
    Float64Stamped,
    Isolation,
    Measurement,
    Signature,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message

TOKEN = '0123456789abcdef'
OPERATOR = Access([Grant(Role.OPERATOR, TOKEN)])


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=300), st.integers(1, 50))
def test_decimation_keeps_every_extreme_and_invents_nothing(values, per_interval):
    stamp = np.arange(len(values)) * 1_000_000
    signal = np.array(values)
    points = envelope(stamp, signal, per_interval * 1_000_000)
    shown = [value for _, value in points if value is not None]
    assert (min(shown), max(shown)) == (min(values), max(values))
    assert set(shown) <= set(values)
    times = [time for time, _ in points]
    assert times == sorted(times)
    assert len(points) <= 2 * (len(values) // per_interval + 2)


def test_decimation_breaks_the_line_where_samples_are_missing():
    stamp = np.array([0, 1, 2, 30, 31]) * 100_000_000
    points = envelope(stamp, np.arange(5.0), 100_000_000)
    assert [2.0 * 0.1, None] in [[round(t, 9), v] for t, v in points]


def test_a_trace_forgets_another_run_and_what_is_too_old():
    trace = Trace(('x',), seconds=1.0, capacity=500)
    for start in range(0, 4000, 100):
        rows = np.zeros(100, trace.dtype)
        rows['stamp'] = (start + np.arange(100)) * 10_000_000
        rows['x'] = start + np.arange(100)
        trace.extend(rows)
    assert trace.rows['x'].tolist() == list(range(3899, 4000))
    again = np.zeros(3, trace.dtype)
    again['stamp'] = [0, 1, 2]
    trace.extend(again)
    assert trace.rows['stamp'].tolist() == [0, 1, 2]


def test_raw_messages_are_read_in_batches_whatever_the_length_of_their_frame_id():
    batch = Batch('damadics_msgs/msg/Measurement', {'cv': 'cv', 'x1': 'x1'})
    sent = []
    for n in range(40):
        message = Measurement(cv=n / 40.0, x1=1.0 - n / 40.0)
        message.header.stamp.sec = n
        message.header.frame_id = 'abcdefghijk'[: n % 11]
        sent.append((n * NANO, message.cv, message.x1))
        batch.take(serialize_message(message))
    assert [tuple(row) for row in batch.drain().tolist()] == sent
    assert len(batch.drain()) == 0


def flag(state: int, level: int = 0, occurrence: int = 0) -> FaultFlag:
    return FaultFlag(state=state, level=level, occurrence=occurrence, threshold=0.2, residual=0.1)


def test_silence_is_never_shown_as_health():
    valve = Valve('lv101')
    assert valve.condition(0.0, 0).kind == 'off'
    valve.take_flag(flag(FaultFlag.STATE_HEALTHY), 100.0)
    valve.threshold_at, valve.period = 100.0, 0.005
    assert valve.condition(100.2, 0).kind == 'ok'
    assert valve.condition(100.95, 0).kind == 'off', 'the detector was killed'
    valve.take_flag(flag(FaultFlag.STATE_HEALTHY), 101.5)
    assert valve.condition(101.6, 0).kind == 'off', 'a heartbeat without samples'
    valve.take_flag(flag(FaultFlag.STATE_NOT_MONITORING), 102.0)
    valve.threshold_at = 102.0
    assert valve.condition(102.1, 0).kind == 'off'


def test_slow_samples_are_not_taken_for_silence():
    valve = Valve('lv101')
    valve.take_flag(flag(FaultFlag.STATE_HEALTHY), 100.5)
    valve.threshold_at, valve.period = 99.0, 1.0
    assert valve.condition(101.0, 0).kind == 'ok'


@pytest.mark.parametrize(
    ('state', 'level', 'kind'),
    [
        (FaultFlag.STATE_ALARM, 1, 'M'),
        (FaultFlag.STATE_ALARM, 2, 'S'),
        (FaultFlag.STATE_LATCHED, 4, 'F'),
        (FaultFlag.STATE_SHELVED, 3, 'C'),
        (FaultFlag.STATE_LEARNING, 3, 'learn'),
        (FaultFlag.STATE_HEALTHY, 0, 'ok'),
    ],
)
def test_every_state_has_its_class(state, level, kind):
    valve = Valve('lv101')
    valve.take_flag(flag(state, level, 1), 100.0)
    valve.threshold_at = 100.0
    assert valve.condition(100.1, 0).kind == kind


def test_an_old_judgement_is_not_shown_as_health():
    now = 1_700_000_000
    valve = Valve('lv101')
    for step in range(4):
        message = flag(FaultFlag.STATE_HEALTHY)
        message.header.stamp.sec = now + step
        valve.take_flag(message, 100.0 + step)
    assert valve.condition(103.1, (now + 3) * NANO + NANO // 10).kind == 'ok'
    late = valve.condition(103.1, (now + 16) * NANO)
    assert (late.kind, late.detail) == ('off', 'samples_old')
    assert late.value == pytest.approx(13.0)


def test_a_queue_that_grows_shows_although_stamps_count_from_the_start_of_a_run():
    valve = Valve('lv101')
    for step in range(10):
        message = flag(FaultFlag.STATE_HEALTHY)
        message.header.stamp.sec = 10 + step
        valve.take_flag(message, 100.0 + 1.5 * step)  # half a second later each time
    assert valve.condition(113.6, 0).detail == 'samples_old'


@pytest.mark.parametrize('followed', [True, False])
@pytest.mark.parametrize('state', [FaultFlag.STATE_NOT_MONITORING, FaultFlag.STATE_UNKNOWN])
def test_a_valve_is_not_old_because_its_detector_was_there_first(followed, state):
    """Flags of before the first sample are stamped 0; the plant starts 5 s later."""
    valve = Valve('lv101')
    for step in range(6):
        valve.take_flag(flag(state), 100.0 + step)
    assert valve.age(105.0, 0) is None, 'no sample yet'
    for step in range(1, 4):
        now = 105.0 + step
        if followed:
            limit = Float64Stamped(data=0.2)
            limit.header.stamp.sec = step
            valve.batches['threshold'].take(serialize_message(limit))
            valve.collect(now)
        message = flag(FaultFlag.STATE_HEALTHY)
        message.header.stamp.sec = step
        valve.take_flag(message, now)
        assert valve.condition(now + 0.1, 0).kind == 'ok'
        assert valve.age(now + 0.1, 0) == pytest.approx(0.1)


def test_a_silent_valve_keeps_its_open_alarm():
    valve = Valve('lv101')
    valve.take_flag(flag(FaultFlag.STATE_ALARM, 1, 1), 100.0)
    valve.take_event(event(FaultEvent.RAISED))
    told = tile(valve, texts('en'), 200.0, 0)
    assert (told['kind'], told['badge']) == ('off', 'alarm open')


def test_a_lost_alarm_state_is_no_health_and_asks_for_a_person():
    valve = Valve('lv101')
    valve.take_flag(flag(FaultFlag.STATE_UNKNOWN), 100.0)
    assert valve.condition(100.1, 0).kind == 'C'
    assert valve.alarm() is not None and not valve.alarm().acknowledged


def test_templates_escape_every_value_and_no_code_builds_markup():
    evil = '<img src=x onerror=alert(1)>"\''
    for template in sorted(TEMPLATES.glob('*.html')):
        assert '|safe' not in template.read_text().replace(' ', ''), template.name
    page = render('message.html', role='alert', title=evil, lines=[evil], address='', link='')
    assert '<img' not in page and 'onerror=alert(1)>"' not in page
    for source in sorted(TEMPLATES.parent.parent.rglob('*.py')):
        text = source.read_text()
        assert not re.search(r"(props|style|classes|html)\(\s*f['\"]", text), source.name


def test_every_language_has_every_text_with_the_same_values():
    english, german = texts('en').entries, texts('de').entries
    assert set(english) == set(german)
    for key, text in english.items():
        assert sorted(re.findall(r'{\w+}', text)) == sorted(re.findall(r'{\w+}', german[key])), key
    code = '\n'.join(p.read_text() for p in TEMPLATES.parent.parent.rglob('*.py'))
    code += '\n'.join(p.read_text() for p in TEMPLATES.glob('*.html'))
    asked = set(re.findall(r"\bt\(\s*'([a-z_A-Z0-9]+)'", code))
    assert asked and asked <= set(english), asked - set(english)


def test_a_spreadsheet_runs_no_text_of_the_export():
    assert cell('=HYPERLINK("http://evil")').startswith("'=")
    assert cell('+1') == "'+1" and cell(-1.5) == -1.5 and cell(None) is None


def test_a_valve_of_a_fleet_is_acted_on_through_its_fleet():
    report = FleetReport(lambda name: known.setdefault(name, Valve(name)), '/plant/fleet')
    known: dict[str, Valve] = {}
    report.take_layout(FleetLayout(valve=['/unit/lv1'], actuator=['LV-1'], area=['unit']))
    valve = known['unit/lv1']
    for service in ACTIONS[:6]:
        name, kind, fields = shared(valve.fleet, service)
        assert name.startswith('/plant/fleet/')
        request = kind.Request(**fields, user='Anna', comment='seen')
        assert request.valves == ['/unit/lv1'], 'as the fleet lists it'
    assert shared(valve.fleet, 'load_reference')[2]['save'] is False


def test_the_file_of_commission_is_read_for_a_replay_and_nonsense_is_refused():
    text = '/**:\n  ros__parameters: {mode: monitor, actuator: LV-1, stiffness: 160000.0}\n'
    assert settings_in_file(text)['stiffness'] == 160000.0
    for bad, said in (
        ('[1, 2', 'no parameter file'),
        ('a: 1', '.+'),
        ('/**:\n  ros__parameters: {stiffness: -1.0}\n', 'stiffness'),
    ):
        with pytest.raises(SettingsError, match=said):
            settings_in_file(bad)


def test_the_alarm_is_acknowledged_by_event_or_by_diagnostics_after_a_restart():
    valve = Valve('lv101')
    valve.take_flag(flag(FaultFlag.STATE_LATCHED, 4, 1), 100.0)
    valve.take_event(event(FaultEvent.RAISED))
    assert not valve.alarm().acknowledged
    valve.take_event(event(FaultEvent.ACKNOWLEDGED))
    assert valve.alarm().acknowledged
    fresh = Valve('lv101')
    fresh.take_flag(flag(FaultFlag.STATE_LATCHED, 4, 1), 100.0)
    fresh.diagnostics['detector'] = {'Acknowledged': 'True'}
    assert fresh.alarm().acknowledged


def test_an_alarm_says_what_is_wrong_how_much_and_what_to_do_then_the_numbers():
    valve = Valve('lv101')
    valve.take_flag(flag(FaultFlag.STATE_ALARM, 1, 1), 100.0)
    told = {'cause': 'friction_up', 'strength': 1.65, 'confidence': 0.99, 'ratio': 0.73}
    valve.take_event({**event(FaultEvent.RAISED), **told})
    valve.isolation = Isolation(occurrence=1, found_by='signature', deviation=0.195)
    words = alarm_words(valve, valve.alarm(), texts('en'), name=True)
    assert words.headline == 'lv101: Friction is 2.6 times normal.'
    assert words.advice.startswith('Check the packing')
    assert words.found.startswith('Found by the valve signature')
    cells = dict(words.cells)
    assert cells['Change'] == '+165 % ± 39 %, confidence 99 %'
    assert cells['Largest residual'] == '73 % of limit'
    valve.isolation.found_by = 'control-room test'
    german = alarm_words(valve, valve.alarm(), texts('de'), name=False)
    assert german.headline == 'Die Reibung beträgt das 2,6-Fache des Normalen.'
    assert german.found == 'Von einem Leitwartentest gefunden.'


def test_an_alarm_of_a_control_rooms_signals_names_its_causes():
    valve = Valve('lv101')
    alarm = FaultFlag(state=FaultFlag.STATE_ALARM, level=1, occurrence=1, threshold=1.0)
    valve.take_flag(alarm, 100.0)
    told = {'cause': 'f19 or f2', 'confidence': 0.71, 'ratio': 1.2, 'threshold': 1.0}
    text = 'flow path or flow sensor: f19 flow sensor or f2 plug or seat sedimentation; '
    text += 'flow 25 % too low'
    valve.take_event({**event(FaultEvent.CHANGED), **told, 'text': text})
    words = alarm_words(valve, valve.alarm(), texts('en'), name=False)
    assert words.headline == 'Looks like f19 flow sensor or f2 plug or seat sedimentation.'
    assert words.text == text
    assert words.found == 'Found by a control-room test.'
    cells = dict(words.cells)
    assert cells['Change'] == 'confidence 71 %'
    assert '1/s' not in cells['Limit']  # a statistic over its limit
    (row,) = history_rows([{**event(FaultEvent.CHANGED), **told, 'text': text}], texts('de'))
    assert row['text'].startswith('Sieht aus nach f19 Durchflussmesser oder f2 Ablagerung')
    assert row['more'].startswith('Durchfluss 25 % zu niedrig. ')
    assert 'flow' not in alarm_words(valve, valve.alarm(), texts('de'), name=False).text


def test_durations_and_times_have_one_form():
    t = texts('en')
    shown = [t.duration(s) for s in (0.04, 9.94, 9.96, 59.4, 59.6, 599.9, 3599.6, 86400.0, 2.6e5)]
    assert shown == [
        '0.0 s', '9.9 s', '10 s', '59 s', '1 min 0 s', '10 min 0 s', '1 h 0 min', '24 h 0 min',
        '3 days',
    ]  # fmt: skip
    assert re.fullmatch(r'2023-11-1\d \d\d:\d\d:\d\d UTC([+-]\d\d:\d\d)?', t.moment(17 * 10**17))


@pytest.mark.parametrize(
    ('scale', 'said'),
    [(1.0, 'lernt, '), (100.0, 'der Eingang ist ausgefallen: x1 = ')],
    ids=['too short', 'percent for fractions'],
)
def test_a_recording_that_is_not_judged_says_why(tmp_path, scale, said):
    lines = [f'{k / 100:.2f},0.5,{0.5 * scale},3e6,2e6,1e5' for k in range(1000)]
    path = tmp_path / 'a.csv'
    path.write_text('\n'.join(['t,cv,x1,p1,p2,ps', *lines, '']))
    (done,) = play(path, 'monitor')
    assert not done.monitored
    assert answer_words(done.status, 'de').startswith(said), done.status


def test_a_size_that_became_known_after_the_event_is_told():
    valve = Valve('lv101')
    valve.take_flag(FaultFlag(state=FaultFlag.STATE_ALARM, level=1, occurrence=1), 100.0)
    valve.take_event({**event(FaultEvent.CHANGED), 'cause': 'friction_up', 'strength': None})

    def told(**values):
        valve.signature = Signature(state=Signature.STATE_ALARM, **values)
        return alarm_words(valve, valve.alarm(), texts('en'), name=False).headline

    unknown = told(cause=Signature.CAUSE_FRICTION_UP, value=math.nan)
    assert 'not known yet' in unknown
    assert told(cause=Signature.CAUSE_SPRING_SOFTER, value=-0.2) == unknown, 'of another cause'
    sized = told(cause=Signature.CAUSE_FRICTION_UP, value=1.65, std=0.1, confidence=0.99)
    assert sized == 'Friction is 2.6 times normal.'
