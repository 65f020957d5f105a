# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The fifteen-minute check of a sceptical user, from one command to the report.

The tests build on each other: one simulated valve, started by one command, serves the first four.
"""

import json
import os
import signal
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest
import website
import yaml
from conftest import PATIENCE, Peer, alone, children, free_port, promised
from damadics_bringup.processes import Processes, executable, surroundings
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultEvent, FaultFlag
from damadics_msgs.srv import InjectFault

pytestmark = pytest.mark.ros
VALVE = 'lv101'
FRICTION = 4  # f4, servomotor and stem friction


@pytest.fixture(scope='module')
def chromium():
    with website.browser() as chromium:
        yield chromium


@pytest.fixture(scope='module')
def first(tmp_path_factory, chromium):
    """The one command, the page it serves, and a node that listens."""
    folder = tmp_path_factory.mktemp('first_look')
    port = free_port()
    fleet = folder / 'fleet.yaml'
    fleet.write_text(
        yaml.safe_dump(
            {
                'valves': {
                    VALVE: {
                        'settings': {'actuator': 'LV-101', **website.LEARN_QUICKLY},
                        # estimator, recorder and page, so that the bag begins with the first sample  # noqa: E501
                        'simulate': {**website.PLANT, 'wait_for_subscribers': 3},
                    }
                }
            }
        )
    )
    with pytest.MonkeyPatch.context() as patch:
        domain = alone(patch, folder)
        peer = Peer(domain, publishes=False)
        flags = peer.listen(FaultFlag, f'/{VALVE}/fault_flag', qos.FLAG)
        events = peer.listen(FaultEvent, f'/{VALVE}/fault_event', qos.EVENTS)
        with Processes(folder / 'logs', surroundings(domain)) as processes:
            processes.forget('PYTEST_CURRENT_TEST')  # the page is to run as it does elsewhere
            processes.start(
                'damadics_bringup',
                'run',
                [
                    str(fleet),
                    '--simulate',
                    '--dashboard',
                    '--port',
                    str(port),
                    '--record',
                    str(folder / 'bag'),
                    '--logs',
                    str(folder / 'logs'),
                ],
            )
            address = f'http://127.0.0.1:{port}'
            website.wait_until_served(address)
            yield SimpleNamespace(
                peer=peer,
                flags=flags,
                events=events,
                processes=processes,
                folder=folder,
                bag=folder / 'bag',
                tile=website.Tile(address, VALVE, chromium and website.new_page(chromium)),
            )
            if not processes.ended('run'):
                processes.end('run', 90.0)
        peer.close()


def rises(first) -> list[int]:
    """Return the stamps at which an alarm was raised [ns], as the topic tells."""
    return [
        e.header.stamp.sec * 10**9 + e.header.stamp.nanosec
        for e in first.events
        if e.transition == FaultEvent.RAISED
    ]


def replayed(*words: object, code: int = 0) -> list[dict]:
    """Replay recordings with the command; return its results."""
    out = Path(os.environ['XDG_STATE_HOME'], 'replay.json')
    out.parent.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(
        [executable('damadics_fd', 'replay'), *map(str, words), '--jobs', '1', '--out', str(out)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == code, done.stderr
    return json.loads(out.read_text())


QUICKLY = [f'--set={name}={value}' for name, value in website.LEARN_QUICKLY.items()]


@pytest.fixture(scope='module')
def faulted(first):
    """The same once its friction is flagged."""
    healthy = (FaultFlag.STATE_HEALTHY,)
    assert first.peer.wait(lambda: first.flags and first.flags[-1].state in healthy)
    first.tile.wait(('ok',))
    first.early = rises(first)
    answer = first.peer.call(InjectFault, f'/{VALVE}/inject_fault', fault=FRICTION, strength=1.0)
    assert answer.success
    assert first.peer.wait(lambda: first.flags[-1].fault), 'the friction is not flagged'
    first.shown_after = first.tile.wait(website.ALARM)
    assert first.peer.wait(lambda: rises(first))
    return first


@pytest.fixture(scope='module')
def restarted(faulted):
    """The same once its detector was killed and is back."""
    faulted.occurrence = faulted.flags[-1].occurrence
    run = children(faulted.processes.pid('run'))
    os.kill(next(child.pid for child in run if child.name == 'detector'), signal.SIGKILL)
    faulted.grey_after = faulted.tile.wait(('off',))
    faulted.peer.wait(lambda: False, 0.3)
    before = len(faulted.flags)
    faulted.tile.wait(website.ALARM)  # `run` has started it again
    assert faulted.peer.wait(lambda: len(faulted.flags) > before + 2)
    faulted.since = list(faulted.flags[before:])
    return faulted


@pytest.fixture(scope='module')
def ended(restarted):
    """The same once `run` was ended; its bag is whole."""
    restarted.peer.wait(lambda: False, 3.0)
    restarted.started = children(restarted.processes.pid('run'))
    restarted.processes.end('run', 90.0)
    restarted.left = [c for c in restarted.started if Path(f'/proc/{c.pid}').exists()]
    return restarted


def test_one_command_shows_a_friction_fault(faulted):
    assert not faulted.early
    assert faulted.shown_after < promised(1.0)


def test_a_killed_detector_greys_the_tile_and_its_alarm_comes_back(restarted):
    assert restarted.grey_after < promised(1.0)
    assert all(flag.fault for flag in restarted.since), 'the alarm was lost'
    assert {flag.occurrence for flag in restarted.since} == {restarted.occurrence}


def test_the_recorded_bag_gives_the_same_flag_time(ended):
    assert len(rises(ended)) == 1, 'the restart raised an alarm'
    assert {child.name for child in ended.started} == {
        'recorder',
        'estimator',
        'detector',
        'plant',
        'dashboard',
    }
    assert not ended.left, 'processes are left'
    (result,) = replayed(ended.bag, *QUICKLY)
    assert result['detections'][0]['stamp'] == rises(ended)[0]


def test_a_truncated_bag_is_replayed(ended):
    (bag,) = ended.bag.glob('*.mcap')
    whole = bag.read_bytes()
    torn = ended.folder / 'torn.mcap'
    torn.write_bytes(whole[: len(whole) * 9 // 10])
    verdict = subprocess.run(
        [executable('damadics_fd', 'verify'), str(torn)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert verdict.returncode == 3, verdict.stdout
    (result,) = replayed(torn, *QUICKLY, code=3)  # something is missing
    assert result['detections'][0]['stamp'] == rises(ended)[0]
    assert result['problems']
