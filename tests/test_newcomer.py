# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A newcomer's hour: init, a driver of one's own, commission, green, a fault, the report on it."""

import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import pytest
import website
import yaml
from conftest import PATIENCE, Peer, free_port
from damadics_bringup.processes import executable
from damadics_fd.ros import qos
from damadics_msgs.msg import Measurement, Signature
from damadics_plant import Simulator

pytestmark = pytest.mark.ros
DRIVER = Path(__file__).resolve().parents[1] / 'docs' / 'examples' / 'driver.py'
TAG, VALVE, RATE = 'LV-101', 'lv_101', 100.0
SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
FRICTION = 'f4'
RECORDED = 30.0  # s of the valve's time, sent several times faster
FASTER = 8.0
STRENGTH = 0.25  # six times the friction
BATCH = 5  # samples between two sleeps


class Reader:
    """What reads the positioner: a simulated valve, written to the driver line by line."""

    def __init__(self) -> None:
        self.valve = Simulator('random_nominal', RATE, 'lugre', seed=5, duration=1e6)
        self.driver = subprocess.Popen(
            [sys.executable, str(DRIVER), f'/{VALVE}'], stdin=subprocess.PIPE, text=True
        )
        self._write(' '.join(('t', *SIGNALS)) + '\n')
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    def _write(self, text: str) -> None:
        assert self.driver.stdin
        self.driver.stdin.write(text)
        self.driver.stdin.flush()

    def send(self, seconds: float, pace: float) -> None:
        """Send that much of the valve's time, as fast as said, at most."""
        origin = began = time.time()
        done = 0
        while done < seconds * RATE and not self._ended.is_set():
            with self._lock:
                columns = self.valve.advance(BATCH)
            rows = zip(*(columns[name].tolist() for name in SIGNALS), strict=True)
            lines = (
                ' '.join((f'{origin + (done + k) / RATE:.6f}', *map(repr, row)))
                for k, row in enumerate(rows)
            )
            self._write('\n'.join(lines) + '\n')
            done += BATCH
            self._ended.wait(max(0.0, began + done / RATE / pace - time.time()))

    def go_on(self) -> None:
        """Send in real time, in a thread of its own, until the end."""
        self._thread = threading.Thread(target=self.send, args=(1e6, 1.0), daemon=True)
        self._thread.start()

    def stick(self) -> None:
        """Let the packing tighten."""
        with self._lock:
            self.valve.inject(FRICTION, STRENGTH)

    def close(self) -> None:
        self._ended.set()
        if self._thread:
            self._thread.join(10.0)
        assert self.driver.stdin
        self.driver.stdin.close()
        self.driver.wait(10.0)


@pytest.fixture
def reader(domain):
    reader = Reader()
    yield reader
    reader.close()


def command(package: str, name: str, *words: object, **options) -> str:
    done = subprocess.run(
        [executable(package, name), *map(str, words)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        **options,
    )
    assert done.returncode == 0, f'{name}: {done.stderr}{done.stdout}'
    return done.stdout


@pytest.fixture
def peer(domain):
    peer = Peer(domain, publishes=False)
    yield peer
    peer.close()


def test_from_nothing_to_a_report_on_a_fault(reader, peer, processes, tmp_path):
    pypdf = pytest.importorskip('pypdf')
    plant = tmp_path / 'my_plant'
    said = command('damadics_bringup', 'init', plant, '--valve', TAG, '--rate', f'{RATE:g}')
    assert str(plant / 'fleet.yaml') in said

    bag = tmp_path / 'good'
    processes.start('damadics_fd', 'recorder', [f'/{VALVE}/measurement', '--out', str(bag)])
    taken = peer.listen(Measurement, f'/{VALVE}/measurement', qos.SAMPLES)
    assert peer.wait(lambda: peer.node.count_subscribers(f'/{VALVE}/measurement') > 1)
    assert peer.wait(lambda: reader.send(0.1, 1.0) or taken), 'the driver has met nobody'
    enough = len(taken) + 0.9 * RECORDED * RATE
    recorded = threading.Thread(target=reader.send, args=(RECORDED, FASTER))
    recorded.start()
    assert peer.wait(lambda: len(taken) >= enough)
    recorded.join()
    processes.end('recorder')
    file = plant / f'{VALVE}.param.yaml'
    said = command('damadics_fd', 'commission', bag, '--actuator', TAG, '--out', file)
    assert 'verdict' in said
    assert yaml.safe_load(file.read_text())['/**']['ros__parameters']['actuator'] == TAG

    fleet = yaml.safe_load((plant / 'fleet.yaml').read_text())
    fleet['valves'][VALVE]['settings'].update(website.LEARN_QUICKLY)
    (plant / 'fleet.yaml').write_text(yaml.safe_dump(fleet))
    port = free_port()
    processes.forget('PYTEST_CURRENT_TEST')
    words = [str(plant / 'fleet.yaml'), '--dashboard', '--port', str(port)]
    processes.start('damadics_bringup', 'run', [*words, '--logs', str(tmp_path / 'logs')])
    address = f'http://127.0.0.1:{port}'
    website.wait_until_served(address)
    reader.go_on()
    tile = website.Tile(address, VALVE)
    learned = peer.listen(Signature, f'/{VALVE}/signature', qos.FLAG)
    tile.wait(('ok',))
    explains = Signature.STATE_VERIFY, Signature.STATE_MONITOR
    assert peer.wait(lambda: learned and learned[-1].state in explains)

    reader.stick()
    tile.wait(website.ALARM)
    alarm = ''
    deadline = time.monotonic() + 60.0
    while 'friction' not in alarm and time.monotonic() < deadline:
        time.sleep(0.3)
        with urllib.request.urlopen(
            f'{address}/report?of={VALVE}&days=1&as=csv', timeout=PATIENCE
        ) as answer:
            alarm = answer.read().decode('utf-8-sig')
    assert 'friction' in alarm, alarm

    out = tmp_path / 'reports'
    command('damadics_dashboard', 'report', VALVE, '--out', out, '--as', 'pdf')
    text = '\n'.join(p.extract_text() for p in pypdf.PdfReader(next(out.glob('*.pdf'))).pages)
    for wanted in (VALVE, 'Friction is', 'Check the packing', time.strftime('%Y-%m-%d')):
        assert wanted in text, f'{wanted} is not in {text}'
