# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Signals from a real OPC UA server in another process: time, quality, loss, bad input."""

import math
import os
import signal
import subprocess
import time

import numpy as np
import pytest
import yaml
from conftest import PATIENCE, Peer, promised
from connect.certificates import make_certificate
from connect.servers import Server
from damadics_bringup.processes import executable
from damadics_fd.ros import qos
from damadics_msgs.msg import FleetLayout, Measurement, MeasurementBlock
from diagnostic_msgs.msg import DiagnosticArray

pytestmark = pytest.mark.ros
SIGNALS = {'cv': 'CV', 'x1': 'PV', 'p1': 'P1', 'p2': 'P2', 't1': 'T1', 'flow': 'FLOW', 'ps': 'PS'}
BAR = {'p1', 'p2', 'ps'}
SECRET = 'open sesame 42'


def valve(number: int, **more) -> dict:
    signals = {
        name: {'node': f'ns=2;s=LV{number}.{end}'} | ({'unit': 'bar'} if name in BAR else {})
        for name, end in SIGNALS.items()
    }
    return {'actuator': f'LV-{number}', 'signals': signals, **more}


class Connector:
    """A running connector and what it publishes."""

    def __init__(self, processes, domain, folder, config: dict) -> None:
        self.folder = folder
        path = folder / 'plant.yaml'
        path.write_text(yaml.safe_dump(config, sort_keys=False))
        self.peer = Peer(domain, publishes=False)
        self.diagnostics = self.peer.listen(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
        self.samples = {
            name: self.peer.listen(Measurement, f'/{name}/measurement', qos.SAMPLES)
            for name in config['valves']
        }
        self.blocks = self.peer.listen(MeasurementBlock, '/measurement_block', qos.SAMPLES)
        self.layouts = self.peer.listen(FleetLayout, '/fleet/layout', qos.latched(1))
        self.processes = processes
        processes.start('damadics_connect', 'opcua', [str(path)])

    def wait(self, condition, patience: float = PATIENCE) -> bool:
        return self.peer.wait(condition, patience)

    def status(self):
        return self.diagnostics[-1].status[0] if self.diagnostics else None

    def says(self, words: str) -> bool:
        return self.wait(lambda: self.status() is not None and words in self.status().message)

    def values(self) -> dict[str, str]:
        return {pair.key: pair.value for pair in self.status().values}

    def log(self) -> str:
        return self.processes.log('opcua').read_text(errors='replace')


@pytest.fixture
def connect(processes, domain, tmp_path):
    made = []

    def make(config):
        made.append(Connector(processes, domain, tmp_path, config))
        return made[-1]

    yield make
    for each in made:
        each.peer.close()


@pytest.fixture
def serve(tmp_path):
    made = []

    def make(*arguments):
        made.append(Server(tmp_path, 'opcua_server.py', *arguments))
        return made[-1]

    yield make
    for each in made:
        each.kill()


def url(server: Server) -> str:
    return f'opc.tcp://127.0.0.1:{server.port}'


def stamps(messages) -> np.ndarray:
    return np.array([m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in messages])


def test_samples_have_source_time_quality_and_units_and_hold_what_does_not_change(connect, serve):
    server = serve(2)
    c = connect(
        {'server': url(server), 'period': 0.5, 'valves': {'lv0': valve(0), 'lv1': valve(1)}}
    )
    assert c.wait(lambda: len(c.samples['lv0']) > 4), c.log()
    held = c.samples['lv0'][-1]
    assert held.p1 == pytest.approx(3.5e6) and held.ps == pytest.approx(1e5)
    assert held.header.frame_id == 'LV-0'
    age = time.time() - stamps([held])[0] * 1e-9
    assert 0.0 < age < 1.5, 'a held value is stamped at most a period (and its way) ago'

    now = time.time_ns() // 1000 * 1000
    when = np.datetime64(now, 'ns').astype('datetime64[us]').item().isoformat() + '+00:00'
    server.tell(f'LV0.PV 0.75 Double 0 {when}')
    assert c.wait(lambda: any(m.x1 == 0.75 for m in c.samples['lv0']))
    first = next(m for m in c.samples['lv0'] if m.x1 == 0.75)
    assert stamps([first])[0] == now

    server.tell('LV0.PV 0.8 Double 0x80310000 -')  # BadNoCommunication
    assert c.wait(lambda: c.samples['lv0'] and math.isnan(c.samples['lv0'][-1].x1))
    assert c.says('bad: lv0 x1: BadNoCommunication')
    server.tell('LV0.PV 0.6 Double 0x40000000 -')  # Uncertain
    assert c.wait(lambda: c.samples['lv0'][-1].x1 == 0.6)
    assert c.wait(lambda: 'lv0 x1' in c.values()['Uncertain'])
    server.tell(f'LV0.CV {"x" * 10_000} String 0 -')  # ten megabytes
    assert c.says('bad: lv0 cv: String where a number is expected')
    assert c.wait(lambda: math.isnan(c.samples['lv0'][-1].cv))
    assert c.samples['lv1'][-1].cv == 0.5
    for messages in c.samples.values():
        assert (np.diff(stamps(messages)) > 0).all()


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGSTOP])
def test_a_lost_server_is_silence_at_once_and_comes_back_without_a_person(connect, serve, number):
    server = serve(1, '--rate', '5')
    c = connect({'server': url(server), 'period': 0.2, 'valves': {'lv0': valve(0)}})
    samples = c.samples['lv0']
    assert c.wait(lambda: len(samples) > 10), c.log()
    server.signal(number)
    lost = time.monotonic()
    c.wait(lambda: False, 3.5)
    ended = len(samples)
    newest = stamps(samples)[-1] * 1e-9
    assert newest < time.time() - 1.9, 'no sample of the last 2 s while the server is away'
    assert c.wait(lambda: c.status().level == b'\x02'), c.status().message
    server.kill()
    server.start()
    assert c.wait(lambda: len(samples) > ended + 5), c.log()
    assert time.monotonic() - lost < promised(20.0)
    assert (np.diff(stamps(samples)) > 0).all(), 'no sample is doubled'
    assert c.wait(lambda: c.values().get('Gaps') == '1')
    assert 'lv0' in c.values()['Last gap']


def test_a_connector_that_was_killed_doubles_nothing_when_it_is_started_again(
    connect, serve, processes, tmp_path
):
    server = serve(1, '--rate', '5')
    c = connect({'server': url(server), 'period': 0.2, 'valves': {'lv0': valve(0)}})
    samples = c.samples['lv0']
    assert c.wait(lambda: len(samples) > 10), c.log()
    processes.kill('opcua')
    killed = time.time()
    c.wait(lambda: False, 1.0)
    assert stamps(samples)[-1] * 1e-9 < killed + 0.1, 'nobody makes samples up for it'
    processes.start('damadics_connect', 'opcua', [str(tmp_path / 'plant.yaml')])
    assert c.wait(lambda: stamps(samples)[-1] * 1e-9 > killed + 2.0), c.log()
    assert (np.diff(stamps(samples)) > 0).all(), 'no sample is doubled'


def test_a_server_that_is_read_gives_the_same_samples(connect, serve):
    server = serve(1)
    c = connect({'server': url(server), 'poll': True, 'period': 0.2, 'valves': {'lv0': valve(0)}})
    assert c.wait(lambda: len(c.samples['lv0']) > 2), c.log()
    now = time.time_ns() // 1000 * 1000
    when = np.datetime64(now, 'ns').astype('datetime64[us]').item().isoformat() + '+00:00'
    server.tell(f'LV0.PV 0.75 Double 0 {when}')
    assert c.wait(lambda: any(m.x1 == 0.75 for m in c.samples['lv0']))
    first = next(m for m in c.samples['lv0'] if m.x1 == 0.75)
    assert stamps([first])[0] == now and first.p1 == pytest.approx(3.5e6)
    assert (np.diff(stamps(c.samples['lv0'])) > 0).all()


@pytest.mark.parametrize(
    ('limits', 'poll'),
    [(('--at-once', '10'), False), (('--at-once', '10'), True), (('--always-report',), False)],
)
def test_a_server_that_takes_little_at_once_is_asked_for_less(connect, serve, limits, poll):
    server = serve(3, *limits)
    valves = {f'lv{n}': valve(n) for n in range(3)}
    c = connect({'server': url(server), 'poll': poll, 'period': 0.2, 'valves': valves})
    assert c.wait(lambda: all(len(got) > 2 for got in c.samples.values())), c.log()
    assert not any(math.isnan(got[0].flow) for got in c.samples.values())
    server.tell('LV2.PV 0.75 Double 0 -')
    assert c.wait(lambda: c.samples['lv2'][-1].x1 == 0.75)


def test_many_valves_in_blocks_every_change_with_its_time(connect, serve, processes):
    server = serve(20, '--rate', '1', '--fast', '2')
    valves = {f'lv{n}': valve(n, period=1.0 if n < 20 else 0.02) for n in range(22)}
    c = connect({'server': url(server), 'publish': 'blocks', 'valves': valves})
    assert c.wait(lambda: sum(len(block.valve) for block in c.blocks) > 300), c.log()

    def reaches(when: float) -> bool:
        """Tell whether both kinds of valves have samples of that time [s]."""
        newest = {n: t for block in c.blocks for n, t in zip(block.valve, block.stamp)}  # noqa: B905
        return min(newest.get(3, 0), newest.get(20, 0)) > when * 1e9

    for hold in (server.signal, lambda number: os.kill(processes.pid('opcua'), number)):
        hold(signal.SIGSTOP)
        c.wait(lambda: False, 1.0)
        hold(signal.SIGCONT)
        goes_on = time.time() + 1.0
        assert c.wait(lambda when=goes_on: reaches(when), promised(20.0)), c.log()
    layout = c.layouts[-1]
    assert layout.valve[3] == '/lv3' and layout.actuator[3] == 'LV-3'
    rows = {}
    for block in c.blocks:
        assert block.layout == layout.version
        for n, stamp, x1 in zip(block.valve, block.stamp, block.x1, strict=True):
            assert rows.setdefault(n, {}).setdefault(stamp, x1) == x1
    for n, period in ((3, 10**9), (20, 2 * 10**7)):
        # the server begins with 0.5, which is held until the first change
        mine = np.array([stamp for stamp in sorted(rows[n]) if rows[n][stamp] != 0.5])
        assert len(mine) > 3
        odd = {int(stamp): int(step) for stamp, step in zip(mine, np.diff(mine), strict=False)}
        odd = {stamp: step for stamp, step in odd.items() if step != period}
        assert odd == {}, 'no change is lost, no time is rounded'
        assert (mine % period == 0).all()
        taken = [rows[n][stamp] for stamp in mine.tolist()]
        assert (np.diff(taken) != 0.0).all(), 'a value was held that had changed'
    assert (
        'lost by the server' in str(c.values().keys())
        and c.values()['Values lost by the server'] == '0'
    )


def test_what_is_wrong_is_told_in_one_line_and_the_others_go_on(connect, serve):
    server = serve(2)
    wrong = valve(0)
    wrong['signals']['p1'] = 'ns=2;s=NO.SUCH'
    wrong['signals']['t1'] = 'what is this'
    c = connect({'server': url(server), 'period': 0.5, 'valves': {'lv0': wrong, 'lv1': valve(1)}})
    assert c.wait(lambda: len(c.samples['lv0']) > 2 and len(c.samples['lv1']) > 2), c.log()
    assert math.isnan(c.samples['lv0'][-1].p1) and c.samples['lv0'][-1].x1 == 0.5
    assert c.says('no such node: what is this (not a node id such as ns=2;s=NAME), ns=2;s=NO.SUCH')


def test_a_wrong_password_is_told_without_it_and_tried_again(connect, serve, tmp_path):
    server = serve(1, '--user')
    (tmp_path / 'password').write_text(SECRET[:-1])
    config = {
        'server': url(server),
        'user': {'name': 'reader', 'password_file': 'password'},
        'valves': {'lv0': valve(0)},
        'period': 0.5,
    }
    c = connect(config)
    assert c.says('wrong user name or password'), c.log()
    words = c.log() + str(c.diagnostics)
    command = subprocess.run(['ps', '-ef'], capture_output=True, text=True).stdout
    assert SECRET[:-1] not in words and SECRET[:-1] not in command
    assert c.log().count('wrong user name') == 1, 'told once, not at every attempt'


def start(folder, config: str, *words: str) -> subprocess.CompletedProcess:
    path = folder / 'wrong.yaml'
    path.write_text(config)
    return subprocess.run(
        [executable('damadics_connect', 'opcua'), str(path), *words],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


def test_every_mistake_in_a_configuration_is_told_at_once(domain, tmp_path):
    done = start(
        tmp_path,
        """
        server: http://plc
        user: {name: me, password: hunter2hunter2}
        perod: 1.0
        valves:
          LV1: {signals: {cv: i=1, x1: {node: i=2, unit: furlong}, zz: i=3}}
          lv2: {period: fast, signals: {cv: {unit: '%'}, x1: i=2}}
        """,
    )
    assert done.returncode == 2
    for words in (
        'server does not begin with opc.tcp://',
        'user.password stands in the file: give password_file or password_env instead',
        'perod: there is no such entry: do you mean period?',
        'a name consists of small letters',
        'x1 cannot be in [furlong]',
        'there is no signal zz',
        'valves.lv2.period is not a number',
        'valves.lv2.signals.cv.node is missing',
    ):
        assert words in done.stderr
    assert 'hunter2' not in done.stderr and 'Traceback' not in done.stderr


def test_browse_proposes_a_configuration_that_runs(connect, serve, domain, tmp_path):
    server = serve(2, '--at-once', '2')
    program = executable('damadics_connect', 'opcua')
    done = subprocess.run(
        [program, '--browse', url(server)], capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 0, done.stderr
    c = connect(yaml.safe_load(done.stdout))
    assert c.wait(lambda: len(c.samples['lv1']) > 2), c.log()


def test_an_encrypted_channel_and_a_server_that_is_another_one(connect, serve, tmp_path):
    for name, uri in (('server', 'urn:freeopcua:python:server'), ('own', 'urn:damadics:connect')):
        make_certificate(tmp_path, name, uri)
    make_certificate(tmp_path, 'another', 'urn:freeopcua:python:server')
    server = serve(1, '--certificates', tmp_path)
    security = {'certificate': 'own.der', 'key': 'own.pem', 'server_certificate': 'server.der'}
    config = {'server': url(server), 'valves': {'lv0': valve(0)}, 'period': 0.5}
    c = connect({**config, 'security': security})
    assert c.wait(lambda: len(c.samples['lv0']) > 2), c.log()
    c.processes.end('opcua')
    c = connect({**config, 'security': {**security, 'server_certificate': 'another.der'}})
    assert c.wait(lambda: 'not connected' in c.log())
    assert not c.samples['lv0'] and 'Traceback' not in c.log()
    c.processes.end('opcua')
    c = connect({**config, 'security': {**security, 'key': 'server.der'}})
    assert c.wait(lambda: 'certificate or key cannot be used' in c.log()), c.log()
