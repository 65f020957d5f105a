# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The HTTP interface with real clients: JSON, events, actions, roles, metrics, hostile input."""

import threading
from collections.abc import Iterator

import httpx
import pytest
from conftest import PATIENCE, alone, free_port, promised
from connect.detectors import Detectors
from connect.event_stream import Message, messages
from connect.servers import listens, wait_for
from damadics_bringup.processes import Processes
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultEvent, FaultFlag, FleetLayout, FleetStatus
from prometheus_client.parser import text_string_to_metric_families

pytestmark = pytest.mark.ros
OPERATOR, VIEWER = 'operator-0123456789abcdef', 'viewer-0123456789abcdef'


class Listener(threading.Thread):
    """A listener on the event stream, as a browser is one."""

    def __init__(self, url: str, **headers: str) -> None:
        super().__init__(daemon=True)
        self.messages: list[Message] = []
        self._url, self._headers, self._over = url, headers, threading.Event()
        self._connected = threading.Event()
        self.start()
        assert self._connected.wait(PATIENCE)

    def run(self) -> None:
        with httpx.stream('GET', self._url, headers=self._headers, timeout=PATIENCE) as stream:
            for message in messages(self._lines(stream)):
                self.messages.append(message)

    def _lines(self, stream: httpx.Response) -> Iterator[str]:
        for line in stream.iter_lines():
            self._connected.set()
            if self._over.is_set():
                return
            yield line

    def close(self) -> None:
        self._over.set()
        self.join(5.0)


@pytest.fixture(scope='module')
def served(tmp_path_factory):
    folder = tmp_path_factory.mktemp('http')
    patch = pytest.MonkeyPatch()
    domain = alone(patch, folder)
    port = free_port()
    (folder / 'tokens').write_text(f'operator {OPERATOR} Ann Example\nviewer {VIEWER}\n')
    (folder / 'http.yaml').write_text(f'port: {port}\ntoken_file: tokens\n')
    detectors = Detectors(domain, 'lv101', 'lv102', 'area/lv103')
    with Processes(folder / 'logs') as processes:
        processes.start('damadics_connect', 'http', [str(folder / 'http.yaml')])
        log = processes.log('http')
        assert wait_for(lambda: listens(port)), log.read_text()
        client = httpx.Client(
            base_url=f'http://127.0.0.1:{port}',
            headers={'Authorization': f'Bearer {OPERATOR}'},
            timeout=PATIENCE,
        )
        assert wait_for(lambda: len(client.get('/api/fleet').json()) == 3)
        yield client, detectors, log
    detectors.close()
    patch.undo()


def test_json_events_actions_and_metrics_of_an_alarm(served):
    client, detectors, log = served
    listener = Listener(f'{client.base_url}/api/events?token={VIEWER}')
    assert wait_for(lambda: client.get('/api/valves/lv101').json()['state'] == 'healthy')
    words = 'friction <script>alert(1)</script> \x1b[31mup'
    stamp = detectors.judge('lv101', FaultEvent.RAISED, words, cause='friction_up')
    told = ('event', 'raised')
    assert wait_for(lambda: told in [(n, d.get('transition')) for _, n, d in listener.messages]), (
        log.read_text()
    )
    event = next(d for _, _, d in listener.messages if d.get('transition') == 'raised')
    assert event['stamp'] == stamp and event['confidence'] == 0.0
    assert '\x1b' not in event['text']

    assert wait_for(
        lambda: [row['valve'] for row in client.get('/api/alarms').json()] == ['lv101']
    )
    row = client.get('/api/valves/lv101').json()
    assert row['cause'] == 'friction_up' and row['ne107'] == 'out_of_specification'
    assert row['ratio'] == 2.0 and row['stamp_utc'].endswith('Z')
    answer = client.post('/api/acknowledge/lv101', json={'comment': 'seen\nit'})
    assert answer.status_code == 200 and answer.json()['text'] == 'acknowledge of lv101'
    assert detectors.calls[-1] == ('lv101', 'acknowledge', 'Ann Example', 'seen it')
    assert wait_for(lambda: client.get('/api/valves/lv101').json()['acknowledged'])
    refused = client.post('/api/reset/lv101', json={})
    assert refused.status_code == 409 and refused.json()['done'] is False
    assert client.post('/api/shelve/area/lv103', json={'duration': 60.0}).status_code == 200
    strokes = client.post('/api/partial_stroke/lv101', json={'amplitude': 0.05, 'count': 3})
    assert strokes.status_code == 200 and detectors.strokes == [('lv101', 0.05, 3)]
    assert detectors.calls[-1] == ('lv101', 'partial_stroke', 'Ann Example', '')
    history = client.get('/api/history', params={'valve': 'lv101'}).json()
    assert [each['transition'] for each in history] == ['acknowledged', 'raised']

    last = listener.messages[-1][0]
    listener.close()
    detectors.judge('lv102', FaultEvent.NEAR_MISS)
    assert wait_for(lambda: client.get('/api/history', params={'valve': 'lv102'}).json())
    again = Listener(f'{client.base_url}/api/events?token={VIEWER}', **{'Last-Event-ID': last})
    missed = [('lv102', 'near_miss')]
    assert wait_for(
        lambda: (
            missed == [(d['valve'], d['transition']) for _, n, d in again.messages if n == 'event']
        )
    )
    again.close()

    detectors.freeze('lv102')  # its detector repeats "healthy", and judges nothing any more
    assert wait_for(lambda: client.get('/api/valves/lv102').json()['state'] == 'not_monitored')
    detectors.freeze('lv102', False)
    assert wait_for(lambda: client.get('/api/valves/lv102').json()['state'] == 'healthy')

    families = {f.name: f for f in text_string_to_metric_families(client.get('/metrics').text)}
    ratio = {s.labels['valve']: s.value for s in families['damadics_ratio'].samples}
    assert ratio['lv101'] == 2.0 and ratio['lv102'] == pytest.approx(0.1)
    states = families['damadics_state'].samples
    mine = [s.labels['state'] for s in states if s.labels['valve'] == 'lv101' and s.value == 1.0]
    assert mine == ['alarm']
    schema = client.get('/openapi.json').json()
    assert '/api/acknowledge/{valve}' in schema['paths']
    page = client.get('/docs').text
    for path in schema['paths']:
        assert f'<code>{path}</code>' in page
    assert '<td>number of the alarm, 0: the present (body)</td>' in page
    assert '//' not in page and '<script' not in page, 'a plant has no other machines to ask'


def test_roles_and_foreign_pages(served):
    client, detectors, log = served
    before = len(detectors.calls)
    bare = httpx.Client(base_url=client.base_url)
    assert bare.get('/api/fleet').status_code == 401
    viewer = {'Authorization': f'Bearer {VIEWER}'}
    assert bare.get('/api/fleet', headers=viewer).status_code == 200
    assert bare.post('/api/reset/lv101', headers=viewer, json={}).status_code == 403
    wrong = {'Authorization': f'Bearer {VIEWER[:-1]}0'}
    assert bare.get('/metrics', headers=wrong).status_code == 401
    foreign = {'Origin': 'http://evil.example'}
    assert client.post('/api/reset/lv101', headers=foreign, json={}).status_code == 403
    assert len(detectors.calls) == before
    words = log.read_text(errors='replace')
    assert OPERATOR not in words and VIEWER not in words


@pytest.mark.parametrize(
    'body',
    [
        b'{',
        b'[]',
        b'{"occurrence": -1}',
        b'{"occurrence": 1e999}',
        b'{"comment": ' + b'[' * 5000 + b']' * 5000 + b'}',
        b'{"user": "' + b'x' * 5000 + b'"}',
        b'{"what": 1}',
        b'\xff\xfe',
        b'x' * 10_000_000,
    ],
    ids=range(9),
)
def test_hostile_bodies_are_refused_and_the_others_go_on(served, body):
    client, detectors, _ = served
    before = len(detectors.calls)
    try:
        answer = client.post(
            '/api/acknowledge/lv101', content=body, headers={'Content-Type': 'application/json'}
        )
        assert answer.status_code in (400, 413, 422)
        assert len(answer.text) < 20_000
    except (httpx.NetworkError, httpx.RemoteProtocolError):
        assert len(body) > 1_000_000, (
            'closed before ten megabytes are taken, the answer cut with it'
        )
    assert len(detectors.calls) == before
    assert client.get('/api/fleet').status_code == 200


def test_a_body_of_unstated_size_is_refused_when_it_is_too_large(served):
    client, detectors, _ = served
    before = len(detectors.calls)
    pieces = (b'{"comment": "', *(b'x' * 1000 for _ in range(100)), b'"}')
    try:
        answer = client.post(
            '/api/acknowledge/lv101',
            content=iter(pieces),
            headers={'Content-Type': 'application/json'},
        )
        assert answer.status_code == 413
    except (httpx.NetworkError, httpx.RemoteProtocolError):
        pass  # the connection is closed before all is taken
    assert len(detectors.calls) == before
    assert client.get('/api/fleet').status_code == 200


def test_silence_of_a_detector_is_not_health(served):
    client, detectors, _ = served
    detectors.silence()
    assert wait_for(
        lambda: {row['state'] for row in client.get('/api/fleet').json()} == {'not_monitored'},
        promised(5.0),
    )
    families = {f.name: f for f in text_string_to_metric_families(client.get('/metrics').text)}
    assert {s.value for s in families['damadics_monitored'].samples} == {0.0}


def test_valves_of_a_fleet_are_told_from_its_status_alone(served):
    client, detectors, _ = served
    node = detectors.node
    layout = node.create_publisher(FleetLayout, '/fleet/layout', qos.latched(1))
    status = node.create_publisher(FleetStatus, '/fleet/status', qos.latched(1))
    names = ['/unit/lv201', '/unit/lv202']
    layout.publish(FleetLayout(version=7, valve=names, actuator=['A', 'B'], area=['Unit', 'Unit']))
    told = FleetStatus(layout=7, valve=[0, 1, 9], fault=[True, False, True], level=[3, 0, 3])
    told.state = [FaultFlag.STATE_ALARM, FaultFlag.STATE_HEALTHY, FaultFlag.STATE_ALARM]
    told.residual, told.threshold, told.ratio = [2.0, 0.1, 9.0], [1.0] * 3, [2.0, 0.1, 9.0]
    told.age, told.progress, told.since = [0.1] * 3, [1.0] * 3, [0] * 3
    told.cause = ['friction_up', '', 'no such valve']

    def valves() -> dict[str, dict]:
        status.publish(told)
        return {each['valve']: each for each in client.get('/api/fleet').json()}

    assert wait_for(lambda: 'unit/lv201' in valves(), pause=0.3)
    found = valves()
    assert (found['unit/lv201']['state'], found['unit/lv201']['cause']) == ('alarm', 'friction_up')
    assert found['unit/lv202']['state'] == 'healthy' and found['unit/lv202']['area'] == 'Unit'
    assert not any('no such valve' in str(each) for each in found.values())
    silent = lambda: {v['valve']: v for v in client.get('/api/fleet').json()}  # noqa: E731
    assert wait_for(lambda: silent()['unit/lv202']['state'] == 'not_monitored', pause=0.2)
