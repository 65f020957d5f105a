# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Live, offline and at any speed: the same flags and residuals, bit for bit."""

import json
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
import rclpy
from conftest import promised
from damadics_bringup.processes import Processes, free_domain, parameters, surroundings
from damadics_fd.bag import read_columns, write_columns
from damadics_fd.commands.replay.live import Player
from damadics_fd.commands.replay.replay import main as replay
from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.monitor import run
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.ros import qos
from damadics_msgs.msg import Measurement
from damadics_plant import simulate
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.task import Future

pytestmark = pytest.mark.ros
GOLDEN = Path(__file__).parents[2] / 'bags'
# what the monitor learns from is shortened, so that it decides within the test
QUICK = {'t_on': 0.5, 't_w': 1.0, 't_learn': 16.0, 'travel_min': 0.01}

# subscribers of estimator, detector and recorder together
CHAIN = {'measurement': 2, 'estimate': 2, 'residual': 1, 'threshold': 1, 'fault_flag': 1}


def excerpt(name: str, begin: float, end: float) -> dict[str, np.ndarray]:
    columns = read_columns(GOLDEN / f'{name}.mcap')
    time = columns.pop('stamp') / 1e9
    del columns['log_time']
    rows = (time >= begin) & (time < end)
    stamp = np.round((time[rows] - begin) * 1e9).astype(np.int64) + 1_000_000
    return {'stamp': stamp} | {signal: values[rows] for signal, values in columns.items()}


def at_scada_rate(scenario: str) -> dict[str, np.ndarray]:
    """Simulate a scenario of the benchmark at 1 Hz until its fault has been there for a while."""
    columns = simulate(scenario, rate=1.0, duration=1000.0, noise=True, seed=3)
    return {name: np.asarray(columns[name]) for name in ('stamp', *SIGNALS)}


@pytest.mark.parametrize(
    ('mode', 'source', 'speeds', 'changes'),
    [
        ('paper', lambda: excerpt('dablib_spring', 66.0, 74.0), (8,), {}),
        ('monitor', lambda: excerpt('lugre_spring', 48.0, 72.0), (4,), QUICK),
        ('scada', lambda: at_scada_rate('f16_B'), (150,), {}),
    ],
    ids=['paper', 'monitor', 'scada'],
)
def test_live_and_offline_agree_bit_for_bit(tmp_path, mode, source, speeds, changes):
    columns = source()
    source = tmp_path / 'source.mcap'
    write_columns(source, columns)
    result = run(columns, Settings.for_mode(mode, **changes))
    rows = result.accepted
    assert result.detections
    recorded = [played(source, tmp_path / str(speed), mode, speed, changes) for speed in speeds]
    for bag in recorded:
        for topic, field in (('/residual', 'residual'), ('/threshold', 'threshold')):
            topic_columns = read_columns(bag, topic)
            assert topic_columns['stamp'].tolist() == columns['stamp'][rows].tolist()
            expected = result.decisions[field][rows]
            assert topic_columns['data'].tobytes() == expected.tobytes(), (bag, topic)
        estimate = read_columns(bag, '/estimate')
        for field in ('xi1', 'xi2', 'phi', 'x2_hat'):
            assert estimate[field].tobytes() == result.estimates[field][rows].tobytes()
        rises = raised(read_columns(bag, '/fault_event'))
        if mode == 'scada':
            tell_the_cause(read_columns(bag, '/fault_event', ['transition', 'cause', 'text']))
        assert set(edges(read_columns(bag, '/fault_flag'))) <= set(rises)
        assert rises == [event.stamp for event in result.detections]
        out = tmp_path / 'again.json'
        settings = [f'--set={key}={value}' for key, value in changes.items()]
        assert replay([str(bag), '--mode', mode, '--out', str(out), *settings]) == 0
        (again,) = json.loads(out.read_text())
        assert [d['stamp'] for d in again['detections']] == rises


def test_live_replay_publishes_signature_and_events_as_the_nodes_do(tmp_path):
    columns = excerpt('lugre_spring', 48.0, 72.0)
    source = tmp_path / 'source.mcap'
    write_columns(source, columns, frame_id='LV-101')
    domain = free_domain()
    own = {**surroundings(domain), 'XDG_STATE_HOME': str(tmp_path / 'state')}
    with Processes(tmp_path / 'logs', own) as processes:
        processes.start('damadics_fd', 'recorder', ['--out', str(tmp_path / 'bag')])
        wait_for_subscribers(domain, processes, dict.fromkeys(('measurement', 'fault_event'), 1))
        settings = [f'--set={key}={value}' for key, value in QUICK.items()]
        processes.start('damadics_fd', 'replay', [str(source), '--live', '--rate', '4', *settings])
        wait_for_end(processes, 'replay')
        processes.check()
        processes.end('recorder')
    bag = tmp_path / 'bag'
    expected = run(columns, Settings.for_mode('monitor', **QUICK))
    assert raised(read_columns(bag, '/fault_event')) == [e.stamp for e in expected.detections]
    signature = read_columns(bag, '/signature')
    assert len(signature['stamp']) >= 19, 'one a second of the recording'
    for topic in ('/measurement', '/estimate', '/fault_flag', '/fault_event', '/signature'):
        tags = read_columns(bag, topic, ['frame_id'])['frame_id']
        assert set(tags.tolist()) == {'LV-101'}, topic


def test_live_replay_leaves_when_a_subscriber_that_was_held_up_has_all(tmp_path):
    columns = excerpt('dablib_spring', 66.0, 74.0)
    source = tmp_path / 'source.mcap'
    write_columns(source, columns)
    domain = free_domain()
    with Processes(tmp_path / 'logs', surroundings(domain)) as processes:
        processes.start('damadics_fd', 'recorder', ['--out', str(tmp_path / 'bag')])
        wait_for_subscribers(domain, processes, {'measurement': 1})
        processes.start('damadics_fd', 'replay', [str(source), '--live', '--rate', '2'])
        wait_for_a_sample(domain)
        os.kill(processes.pid('recorder'), signal.SIGSTOP)
        time.sleep(10.0)
        assert not processes.ended('replay')
        os.kill(processes.pid('recorder'), signal.SIGCONT)
        wait_for_end(processes, 'replay')
        assert processes.exit_code('replay') == 0
        processes.end('recorder')
    recorded = read_columns(tmp_path / 'bag', '/measurement')
    assert recorded['stamp'].tolist() == columns['stamp'].tolist()


def test_live_replay_leaves_the_clock_of_its_node_alone():
    context = Context()
    rclpy.init(context=context, domain_id=free_domain())
    try:
        player = Player(1.0, None, 'LV-101', context=context)
        assert player.get_clock().now().nanoseconds > 0
        player.destroy_node()
    finally:
        context.try_shutdown()


def tell_the_cause(events: dict[str, np.ndarray]) -> None:
    """See that a person who reads the events alone learns test, cause and how much is off."""
    named = [cause for cause in events['cause'].tolist() if cause]
    assert named, 'no event names the cause'
    assert 'f16' in named[-1]
    (*_, text) = [text for text in events['text'].tolist() if 'f16 supply pressure drop' in text]
    assert '% of the stroke too far' in text


def raised(events: dict[str, np.ndarray]) -> list[int]:
    """Return the stamps at which a fault was flagged."""
    return events['stamp'][events['transition'] == RAISED].tolist()


def edges(flags: dict[str, np.ndarray]) -> list[int]:
    """Return the stamps at which the recorded flag rises."""
    fault = flags['fault'].astype(bool)
    return flags['stamp'][fault & ~np.concatenate(([False], fault[:-1]))].tolist()


def played(source: Path, folder: Path, mode: str, speed: int, changes: dict) -> Path:
    """Publish a recording to estimator, detector and recorder as processes; return the bag."""
    domain = free_domain()
    own = {**surroundings(domain), 'XDG_STATE_HOME': str(folder / 'state')}  # no alarm of before
    with Processes(folder / 'logs', own) as processes:
        processes.start('damadics_fd', 'recorder', ['--out', str(folder / 'bag')])
        for node in ('detector', 'estimator'):
            processes.start('damadics_fd', node, parameters(mode=mode, **changes))
        wait_for_subscribers(domain, processes, CHAIN)
        processes.start(
            'damadics_fd',
            'replay',
            [
                str(source),
                '--live',
                '--inputs-only',
                '--rate',
                str(speed),
            ],
        )
        wait_for_end(processes, 'replay')
        processes.check()
        for node in ('estimator', 'detector', 'recorder'):
            processes.end(node, 60.0)  # it may be learning
    return folder / 'bag'


def wait_for_subscribers(
    domain: int, processes: Processes, wanted: dict[str, int], patience: float = 120.0
) -> None:
    """Wait until topics are subscribed to, each by so many."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('watcher', context=context)
    deadline = time.monotonic() + patience
    while any(node.count_subscribers(topic) < count for topic, count in wanted.items()):
        assert time.monotonic() < deadline
        processes.check()
        time.sleep(0.1)
    node.destroy_node()
    context.try_shutdown()


def wait_for_a_sample(domain: int, patience: float = 120.0) -> None:
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('watcher', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    came: Future = Future()
    node.create_subscription(Measurement, 'measurement', came.set_result, qos.SAMPLES)
    executor.spin_until_future_complete(came, patience)
    assert came.done()
    node.destroy_node()
    context.try_shutdown()


def wait_for_end(processes: Processes, name: str, patience: float = 100.0) -> None:
    deadline = time.monotonic() + patience
    while not processes.ended(name):
        assert time.monotonic() < deadline
        processes.check()
        time.sleep(0.1)
    time.sleep(min(promised(2.0), 20.0))  # the last messages pass through the chain
