# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page without a browser: traces, honest decimation, words, access, history."""

import asyncio
import re
import sqlite3

import numpy as np
import pytest
from damadics_dashboard.dashboard import main, read_tokens
from damadics_dashboard.live.fleet import FleetReport, shared
from damadics_dashboard.live.raw import Batch
from damadics_dashboard.live.record import ACTIONS
from damadics_dashboard.live.traces import NANO, Trace, envelope
from damadics_dashboard.live.valve import Valve
from damadics_dashboard.pages.fleet_page import tile
from damadics_dashboard.pages.playback import settings_in_file
from damadics_dashboard.pages.valve_words import alarm_words
from damadics_dashboard.server.access import COOKIE, Guard, check_binding
from damadics_dashboard.server.limits import SizeLimit
from damadics_dashboard.store.export import cell
from damadics_dashboard.store.history import History, Wanted
from damadics_dashboard.words.templates import TEMPLATES, render
from damadics_dashboard.words.texts import texts
from damadics_fd.core.settings import SettingsError
from damadics_fd.store.access import Access, AccessError, Grant, Role
from damadics_msgs.msg import FaultEvent, FaultFlag, FleetLayout, Isolation, Measurement
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


def event(transition: int, text: str = 'raised', occurrence: int = 1, stamp: int = 5) -> dict:
    return {
        'valve': 'lv101',
        'stamp': stamp,
        'transition': transition,
        'occurrence': occurrence,
        'level': 4,
        'onset': 4,
        'residual': 0.4,
        'threshold': 0.2,
        'ratio': 2.0,
        'duration': 1.0,
        'cause': 'friction',
        'confidence': None,
        'strength': 0.5,
        'text': text,
        'advice': 'look',
    }


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


def test_history_survives_and_takes_a_repeated_event_once(tmp_path):
    path = tmp_path / 'state' / 'history.sqlite'
    first = History(path)
    assert first.add(event(FaultEvent.RAISED))
    assert first.add(event(FaultEvent.CLEARED, 'cleared'))
    first.close()
    second = History(path)
    assert not second.add(event(FaultEvent.RAISED)), 'the detector repeats it to a newcomer'
    assert second.add(event(FaultEvent.RAISED)), 'the same run again is another event'
    assert [row['transition'] for row in second.latest()] == [0, 1, 0]
    assert second.valves() == ['lv101']
    second.close()


def test_history_finds_by_word_valve_kind_and_time(tmp_path):
    history = History(tmp_path / 'history.sqlite')
    for n in range(5):
        history.add({**event(FaultEvent.RAISED, f'raised {n} 50%', stamp=n), 'valve': f'v{n}'})
    history.add(event(FaultEvent.CLEARED, 'cleared'))
    found = [row['text'] for row in history.find(Wanted(text='raised 3'))]
    assert found == ['raised 3 50%']
    assert len(history.find(Wanted(text='50%'))) == 5 and not history.find(Wanted(text='5_%'))
    assert len(history.find(Wanted(valve='v1'))) == 1
    assert len(history.find(Wanted(transitions=(FaultEvent.CLEARED,)))) == 1
    assert not history.find(Wanted(until=1.0))
    assert len(history.find(Wanted(), 2, 4)) == 2
    history.close()


def test_what_people_did_is_kept_once_though_page_and_node_tell_it(tmp_path):
    history = History(tmp_path / 'history.sqlite')
    action = {'valve': 'v', 'action': 'reset', 'user': 'Anna', 'role': 'operator'}
    action |= {'comment': 'packing', 'done': 1, 'result': 'reset'}
    assert history.add_action(action)
    assert not history.add_action({**action, 'role': ''}), 'the node says it again'
    assert [row['user'] for row in history.actions()] == ['Anna']
    history.close()


def test_a_locked_history_waits_in_memory_and_is_written_later(tmp_path):
    path = tmp_path / 'history.sqlite'
    history = History(path)
    holder = sqlite3.connect(path)
    holder.execute('BEGIN IMMEDIATE')
    assert history.add(event(FaultEvent.RAISED))
    assert 'tried again' in history.problem
    holder.rollback()
    history.retry()
    assert history.problem == '' and len(history.latest()) == 1
    history.close()


@pytest.mark.parametrize('content', [b'garbage' * 99, b'SQLite format 3\0' + bytes(5000), None])
def test_a_damaged_history_is_moved_aside_and_begun_anew(tmp_path, content):
    path = tmp_path / 'history.sqlite'
    if content is None:
        path.mkdir()
    else:
        path.write_bytes(content)
    history = History(path)
    assert 'the file of before is' in history.problem
    assert history.add(event(FaultEvent.RAISED)) and len(history.latest()) == 1
    assert len(list(tmp_path.glob('history.sqlite.bad-*'))) == 1
    history.close()


def test_a_history_whose_description_is_no_text_is_moved_aside_each_time_under_a_name(tmp_path):
    path = tmp_path / 'history.sqlite'
    for _ in range(2):  # in one second
        History(path).close()
        whole = path.read_bytes()
        path.write_bytes(whole.replace(b'CREATE TABLE event', b'CREATE TABLE \xff\xae\xffnt'))
        for journal in tmp_path.glob('*-*l'):
            journal.unlink()
        History(path).close()
    assert len(list(tmp_path.glob('history.sqlite.bad-*'))) == 2


def test_damaged_rows_of_a_history_are_left_out_and_told(tmp_path):
    path = tmp_path / 'history.sqlite'
    history = History(path)
    history.add(event(FaultEvent.RAISED, 'whole'))
    history.add(event(FaultEvent.RAISED, 'text'))
    history.add(event(FaultEvent.RAISED, 'stamp'))
    history.close()
    with sqlite3.connect(path) as file:
        file.execute("UPDATE event SET valve = CAST(x'50ff45' AS TEXT) WHERE text = 'text'")
        file.execute("UPDATE event SET stamp = 'yesterday' WHERE text = 'stamp'")
    history = History(path)
    assert [row['text'] for row in history.latest()] == ['text', 'whole']
    assert 'P\ufffdE' in history.valves()
    assert 'left out' in history.problem
    history.close()


@pytest.mark.parametrize('host', ['0.0.0.0', '::', '192.168.1.5', 'plant-pc'])
def test_the_network_needs_a_token(host, capsys, monkeypatch):
    monkeypatch.delenv('DAMADICS_DASHBOARD_TOKEN', raising=False)
    assert main(['--host', host]) == 2
    assert 'token' in capsys.readouterr().err
    check_binding(host, OPERATOR)


@pytest.mark.parametrize('port', ['0', '65536', '99999', 'x'])
def test_a_port_that_cannot_be_is_refused_at_once(port, capsys):
    with pytest.raises(SystemExit) as end:
        main(['--port', port])
    assert end.value.code == 2 and 'is no port' in capsys.readouterr().err


def test_a_bad_token_is_refused(tmp_path):
    with pytest.raises(AccessError, match='No such file'):
        read_tokens(tmp_path / 'none')
    for text, said in (
        ('\n', 'no token'),
        ('short', 'too short'),
        ('ab+c/d=0123456789', 'letters'),
    ):
        (tmp_path / 'bad').write_text(text)
        with pytest.raises(AccessError, match=said):
            read_tokens(tmp_path / 'bad')


def send(application, path: str = '/', query: str = '', kind: str = 'http', body=(), **headers):
    """Send a request through a middleware; return the messages of its answer."""
    sent, pieces = [], list(body)

    async def receive():
        more = len(pieces) > 1
        return {
            'type': 'http.request',
            'body': pieces.pop(0) if pieces else b'',
            'more_body': more,
        }

    async def take(message):
        sent.append(message)

    raw = {'host': '127.0.0.1:8080', **{k.replace('_', '-'): v for k, v in headers.items()}}
    scope = {'type': kind, 'path': path, 'query_string': query.encode()}
    scope['headers'] = [(k.encode('latin-1'), v.encode('latin-1')) for k, v in raw.items()]
    asyncio.run(application(scope, receive, take))
    return sent


async def welcome(scope, receive, send):
    if scope['type'] == 'websocket':
        await send({'type': 'websocket.accept'})
        return
    while (await receive()).get('more_body'):
        pass
    await send({'type': 'http.response.start', 'status': 200, 'headers': []})


def ask(access: Access, kind: str = 'http', query: str = '', **headers: str) -> int:
    """Send a request through the guard and return the status, 101 for an open socket."""
    first = send(Guard(welcome, access), query=query, kind=kind, **headers)[0]
    return {'websocket.close': 403, 'websocket.accept': 101}.get(first['type']) or first['status']


@pytest.mark.parametrize('kind', ['http', 'websocket'])
def test_the_guard_lets_in_who_may_and_no_other(kind):
    open_ = 200 if kind == 'http' else 101
    free = Access()
    assert ask(free, kind) == open_
    assert ask(free, kind, host='evil.example') == 403, 'a foreign name bound to this address'
    assert ask(free, kind, origin='http://evil.example') == 403, 'a page of another site'
    assert ask(free, kind, origin='http://127.0.0.1:8080') == open_
    assert ask(OPERATOR, kind) == 403
    assert ask(OPERATOR, kind, cookie=f'{COOKIE}={TOKEN}', host='plant-pc') == open_
    assert ask(OPERATOR, kind, cookie=f'{COOKIE}=wrong') == 403


@pytest.mark.parametrize('access', [Access(), 'token'])
@pytest.mark.parametrize(
    'headers',
    [
        {'host': '[::1'},
        {'host': '[x]:1'},
        {'origin': 'http://[x'},
        {'origin': 'null'},
        {'host': ''},
    ],
)
def test_what_cannot_be_read_is_refused_not_a_traceback(access, headers):
    access = OPERATOR if access == 'token' else access
    given = {'cookie': f'{COOKIE}={TOKEN}'} if access is OPERATOR else {}
    refused = ask(access, **given, **headers)
    assert refused == 403 or (access is OPERATOR and headers == {'host': ''})


def test_no_other_page_can_frame_this_one_and_types_are_not_guessed():
    answer = send(Guard(welcome, Access()))
    headers = dict(answer[0]['headers'])
    assert b"frame-ancestors 'none'" in headers[b'content-security-policy']
    assert headers[b'x-frame-options'] == b'DENY'
    assert headers[b'x-content-type-options'] == b'nosniff'
    assert headers[b'referrer-policy'] == b'no-referrer'


def redirect(path: str, query: str) -> dict:
    answer = send(Guard(welcome, OPERATOR), path, query)
    assert answer[0]['status'] == 303
    return dict(answer[0]['headers'])


def test_the_token_moves_from_the_address_into_a_cookie_and_nowhere_else():
    headers = redirect('/valve/a b', f'window=10&token={TOKEN}')
    assert headers[b'location'] == b'/valve/a%20b?window=10'
    assert TOKEN.encode() in headers[b'set-cookie'] and b'HttpOnly' in headers[b'set-cookie']
    for path in ('//evil.com/', '/\\evil.com', '/\r\nX-Injected: 1'):
        place = redirect(path, f'token={TOKEN}')[b'location'].decode()
        assert re.fullmatch(r'/[^/\\\s][^\\\s]*', place), place
    assert ask(OPERATOR, query='token=wrong') == 403


def test_a_viewer_is_let_in_as_one(monkeypatch):
    seen = []

    async def look(scope, receive, send):
        seen.append(scope['damadics.grant'].role)
        await welcome(scope, receive, send)

    access = Access([Grant(Role.VIEWER, TOKEN, 'Anna')])
    send(Guard(look, access), cookie=f'{COOKIE}={TOKEN}')
    assert seen == [Role.VIEWER]


def test_what_is_too_large_is_answered_with_413_before_it_is_taken():
    limit = SizeLimit(welcome, upload=1000, request=100)
    status = [send(limit, '/x', content_length='101')[0]['status']]
    status.append(send(limit, '/_nicegui/client/1', content_length='1001')[0]['status'])
    status.append(send(limit, '/x', body=[b'a' * 60, b'b' * 60])[0]['status'])
    assert status == [413, 413, 413]
    assert send(limit, '/x', body=[b'a' * 60, b'b' * 40])[0]['status'] == 200
    assert send(limit, '/_nicegui/client/1', body=[b'a' * 999])[0]['status'] == 200


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
    assert cells['Change'] == '+165% ± 39%, confidence 99%'
    assert cells['Largest residual'] == '73 % of limit'
    valve.isolation.found_by = 'control-room test'
    german = alarm_words(valve, valve.alarm(), texts('de'), name=False)
    assert german.headline == 'Die Reibung beträgt das 2,6-Fache des Normalen.'
    assert german.found == 'Von einem Leitwartentest gefunden.'


def test_durations_and_times_have_one_form():
    t = texts('en')
    shown = [t.duration(s) for s in (0.04, 9.94, 9.96, 59.4, 59.6, 599.9, 3599.6, 86400.0, 2.6e5)]
    assert shown == [
        '0.0 s', '9.9 s', '10 s', '59 s', '1 min 0 s', '10 min 0 s', '1 h 0 min', '24 h 0 min',
        '3 days',
    ]  # fmt: skip
    assert re.fullmatch(r'2023-11-1\d \d\d:\d\d:\d\d UTC([+-]\d\d:\d\d)?', t.moment(17 * 10**17))
