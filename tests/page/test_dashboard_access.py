# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who is let in to the page, and what it takes from whom."""

import asyncio
import logging
import re
import socket
import threading
import time

import pytest
from damadics_dashboard.dashboard import main, read_tokens
from damadics_dashboard.server.access import COOKIE, Guard, check_binding
from damadics_dashboard.server.log import keep_short
from damadics_fd.store.access import Access, AccessError, Grant, Role
from damadics_fd.web import limits
from damadics_fd.web.limits import PatientProtocol, SizeLimit

uvicorn = pytest.importorskip('uvicorn')
TOKEN = '0123456789abcdef'
OPERATOR = Access([Grant(Role.OPERATOR, TOKEN)])


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


def test_a_person_without_a_token_is_asked_for_it_a_program_is_refused_in_words():
    def answer(query: str = '', **headers: str) -> tuple[int, str, str]:
        first, last = send(Guard(welcome, OPERATOR), '/valve/lv101', query, **headers)
        return (
            first['status'],
            dict(first['headers'])[b'content-type'].decode(),
            last['body'].decode(),
        )

    status, kind, page = answer(accept='text/html,*/*')
    assert (status, kind) == (403, 'text/html; charset=utf-8')
    assert 'method="get"' in page and 'name="token"' in page, 'asked as ?token=, which is known'
    assert 'not known' not in page and 'action=' not in page, 'it leads back to the same address'
    assert 'not known' in answer('token=wrong', accept='text/html')[2]
    assert 'secret77' not in answer('token=secret77', accept='text/html')[2]
    assert 'nicht bekannt' in answer('token=x', accept='text/html', accept_language='de')[2]
    assert answer(accept='*/*')[1].startswith('text/plain')
    foreign = answer(accept='text/html', origin='http://evil.example')
    assert foreign[0] == 403 and '<form' not in foreign[2]


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


def test_what_a_visitor_sends_is_a_line_of_the_log(caplog):
    keep_short()
    try:
        raise ValueError('unexpected end\nof data')
    except ValueError:
        logging.getLogger('engineio.server').exception('message async handler error')
    assert caplog.messages == ['a malformed message was refused: ValueError: unexpected end']
    assert 'Traceback' not in caplog.text


@pytest.fixture
def house(monkeypatch):
    """A server with the page's protocol, little patience and few places; its port."""
    monkeypatch.setattr(limits, 'HEAD_TIME', 0.3)
    monkeypatch.setattr(limits, 'MOST_CONNECTIONS', 5)

    async def answer(scope, receive, send):
        await welcome(scope, receive, send)
        await send({'type': 'http.response.body', 'body': b'welcome'})

    config = uvicorn.Config(answer, http=PatientProtocol, log_level='error', lifespan='off')
    server = uvicorn.Server(config)
    with socket.create_server(('127.0.0.1', 0)) as door:
        thread = threading.Thread(target=server.run, kwargs={'sockets': [door]})
        thread.start()
        yield door.getsockname()[1]
        server.should_exit = True
        thread.join(10.0)


def visitor(port: int, words: bytes) -> socket.socket:
    visit = socket.create_connection(('127.0.0.1', port), 10.0)
    visit.sendall(words)
    return visit


def test_who_never_ends_the_head_of_a_request_is_shown_the_door(house):
    begun = b'GET / HTTP/1.1\r\nHost: x\r\n'
    slow = [visitor(house, part) for part in (b'', b'G', begun, begun + b'X: ')]
    began = time.monotonic()
    assert [visit.recv(100) for visit in slow] == [b''] * 4
    assert time.monotonic() - began < 5.0
    good = visitor(house, begun + b'\r\n')
    assert good.recv(100).startswith(b'HTTP/1.1 200')


def test_a_full_house_takes_nobody_in_and_goes_on(house):
    whole = b'GET / HTTP/1.1\r\nHost: x\r\n\r\n'
    staying = [visitor(house, b'') for _ in range(20)]
    answers = []
    deadline = time.monotonic() + 10.0
    while b'HTTP/1.1 200' not in answers and time.monotonic() < deadline:
        try:
            answers.append(visitor(house, whole).recv(12))
        except OSError:
            answers.append(b'')
    assert answers[-1] == b'HTTP/1.1 200', 'those who stayed were not shown the door'
    for visit in staying:
        visit.close()
