# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page without a browser: traces, honest decimation, words, access, history."""

import asyncio

import numpy as np
import pytest
from damadics_dashboard import markup
from damadics_dashboard.access import COOKIE, AccessError, Guard, check_binding
from damadics_dashboard.dashboard import main, read_token
from damadics_dashboard.history import History
from damadics_dashboard.raw import Batch
from damadics_dashboard.traces import NANO, Trace, envelope
from damadics_dashboard.valve import Valve
from damadics_msgs.msg import FaultEvent, FaultFlag, Measurement
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import serialize_message

TOKEN = '0123456789abcdef'


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
    assert valve.condition(0.0).kind == 'off'
    valve.take_flag(flag(FaultFlag.STATE_HEALTHY), 100.0)
    valve.threshold_at, valve.period = 100.0, 0.005
    assert valve.condition(100.2).kind == 'ok'
    assert valve.condition(100.95).kind == 'off', 'the detector was killed'
    valve.take_flag(flag(FaultFlag.STATE_HEALTHY), 101.5)
    assert valve.condition(101.6).kind == 'off', 'a heartbeat without samples'
    valve.take_flag(flag(FaultFlag.STATE_NOT_MONITORING), 102.0)
    valve.threshold_at = 102.0
    assert valve.condition(102.1).kind == 'off'


def test_slow_samples_are_not_taken_for_silence():
    valve = Valve('lv101')
    valve.take_flag(flag(FaultFlag.STATE_HEALTHY), 100.5)
    valve.threshold_at, valve.period = 99.0, 1.0
    assert valve.condition(101.0).kind == 'ok'


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
    assert valve.condition(100.1).kind == kind


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


def test_texts_from_outside_are_escaped_everywhere():
    evil = '<img src=x onerror=alert(1)>"\''
    valve = Valve('lv101')
    valve.tag = evil
    valve.take_flag(flag(FaultFlag.STATE_ALARM, 4, 1), 100.0)
    valve.take_event({**event(FaultEvent.RAISED, evil), 'cause': evil, 'advice': evil})
    valve.name = evil
    pages = [
        markup.tile(valve, 100.1),
        markup.banner(valve, valve.condition(100.1), 100.1),
        markup.alarm_body(valve, valve.alarm(), name=True),
        markup.history_table([{**event(0, evil), 'valve': evil}], name=True),
    ]
    for page in pages:
        assert '<img' not in page
        assert 'onerror=alert(1)>"' not in page


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


@pytest.mark.parametrize('host', ['0.0.0.0', '::', '192.168.1.5', 'plant-pc'])
def test_the_network_needs_a_token(host, capsys, monkeypatch):
    monkeypatch.delenv('DAMADICS_DASHBOARD_TOKEN', raising=False)
    assert main(['--host', host]) == 1
    assert 'token' in capsys.readouterr().err
    check_binding(host, TOKEN)


def test_a_bad_token_is_refused(tmp_path):
    with pytest.raises(AccessError, match='too short'):
        check_binding('0.0.0.0', 'short')
    with pytest.raises(AccessError, match='No such file'):
        read_token(tmp_path / 'none')
    (tmp_path / 'empty').write_text('\n')
    with pytest.raises(AccessError, match='is empty'):
        read_token(tmp_path / 'empty')


def ask(token: str, kind: str = 'http', query: str = '', **headers: str) -> int:
    """Send a request through the guard and return the status, 101 for an open socket."""
    sent = []

    async def application(scope, receive, send):
        sent.append({'status': 200 if scope['type'] == 'http' else 101})

    async def send(message):
        sent.append(message)

    raw = [(k.encode(), v.encode()) for k, v in {'host': '127.0.0.1:8080', **headers}.items()]
    scope = {'type': kind, 'path': '/', 'query_string': query.encode(), 'headers': raw}
    asyncio.run(Guard(application, token)(scope, None, send))
    return 403 if sent[0].get('type') == 'websocket.close' else sent[0]['status']


@pytest.mark.parametrize('kind', ['http', 'websocket'])
def test_the_guard_lets_in_who_may_and_no_other(kind):
    open_ = 200 if kind == 'http' else 101
    assert ask('', kind) == open_
    assert ask('', kind, host='evil.example') == 403, 'a foreign name bound to this address'
    assert ask('', kind, origin='http://evil.example') == 403, 'a page of another site'
    assert ask('', kind, origin='http://127.0.0.1:8080') == open_
    assert ask(TOKEN, kind) == 403
    assert ask(TOKEN, kind, cookie=f'{COOKIE}={TOKEN}', host='plant-pc') == open_
    assert ask(TOKEN, kind, cookie=f'{COOKIE}=wrong') == 403


def test_the_token_moves_from_the_address_into_a_cookie():
    assert ask(TOKEN, query=f'token={TOKEN}') == 303
    assert ask(TOKEN, query='token=wrong') == 403
