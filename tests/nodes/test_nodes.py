# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Estimator and detector as processes: samples in, flags out, bad input, parameters, signals."""

import itertools
import os
import signal
import subprocess
import time

import numpy as np
import pytest
from conftest import PATIENCE, PYTEST, free_port, promised
from damadics_bringup.processes import (
    executable,
    parameters,
)
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_fd.ros import qos
from damadics_msgs.msg import Estimate, FaultEvent, FaultFlag, Float64Stamped
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

pytestmark = pytest.mark.ros
PERIOD = 2_500_000  # ns
SPEAK_AT_ONCE = {'PYTHONUNBUFFERED': '1', 'RCUTILS_LOGGING_BUFFERED_STREAM': '0'}


@pytest.fixture
def chain(processes, peer):
    """Start estimator and detector in paper mode and listen to all that they say."""
    for name in ('estimator', 'detector'):
        processes.start('damadics_fd', name, parameters(mode='paper'))
    for kind, topic in (
        (Estimate, 'estimate'),
        (Float64Stamped, 'residual'),
        (Float64Stamped, 'threshold'),
    ):
        peer.listen(kind, topic, qos.SAMPLES)
    peer.listen(FaultFlag, 'fault_flag', qos.FLAG)
    peer.listen(FaultEvent, 'fault_event', qos.EVENTS)
    peer.listen(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
    graph = peer.node
    assert peer.wait(
        lambda: (
            peer.publisher.get_subscription_count() == 1
            and graph.count_subscribers('/estimate') == 2
            and graph.count_publishers('/residual') == 1
            and peer.got['fault_flag']
        ),
    ), 'the nodes did not start'
    peer.await_met('estimator', 'detector')
    return peer


def moving_stem(samples: int) -> dict[str, np.ndarray]:
    t = np.arange(samples) * PERIOD * 1e-9
    x1 = 0.5 + 0.3 * np.sin(1.5 * t) + 0.05 * (t > 1.0)
    cv = 0.5 + 0.3 * np.sin(1.5 * t + 0.2)
    return {'stamp': np.arange(samples) * PERIOD, 'cv': cv, 'x1': x1}


def test_the_nodes_give_what_the_core_gives_bit_for_bit(chain):
    columns = moving_stem(1200)
    chain.send_columns(columns)
    others = {'p1': 3.5e6, 'p2': 2.6e6, 't1': 20.0, 'flow': 5.0, 'ps': 1e5}
    full = {name: np.full(1200, value) for name, value in others.items()}
    result = run({**columns, **full}, Settings.for_mode('paper'))
    heard = ('estimate', 'residual', 'threshold')
    assert chain.wait(lambda: all(len(chain.got[topic]) == 1200 for topic in heard))
    assert [m.xi2 for m in chain.got['estimate']] == result.estimates['xi2'].tolist()
    assert [m.x2 for m in chain.got['estimate']] == result.estimates['x2'].tolist()
    assert [m.data for m in chain.got['residual']] == result.decisions['residual'].tolist()
    assert [m.data for m in chain.got['threshold']] == result.decisions['threshold'].tolist()
    assert result.detections, 'the step of the stem was meant to be flagged'
    # of two changes of the flag within a moment only the last may arrive, but every event
    events = chain.got['fault_event']
    raised = [m.header.stamp for m in events if m.transition == FaultEvent.RAISED]
    assert [stamp.sec * 10**9 + stamp.nanosec for stamp in raised] == [
        event.stamp for event in result.detections
    ]


def test_bad_samples_do_not_reach_the_filters_and_are_counted(chain):
    columns = moving_stem(600)
    bad = {100: ('x1', float('nan')), 200: ('cv', float('inf')), 300: ('x1', 55.0)}
    sent = 0
    for n in range(600):
        stamp, cv, x1 = (columns[k][n].item() for k in ('stamp', 'cv', 'x1'))
        if n in bad:
            name, value = bad[n]
            chain.send(stamp, **{'cv': cv, 'x1': x1, name: value})
            continue
        chain.send(stamp, cv, x1)
        sent += 1
        if n == 400:  # the one before comes again, and one out of order
            chain.send(stamp, cv, x1)
            chain.send(stamp - 5 * PERIOD, cv, x1)
    assert chain.wait(lambda: len(chain.got['estimate']) == sent)

    def counts() -> dict[str, str]:
        reports = [s for m in chain.got['/diagnostics'] for s in m.status if 'estimator' in s.name]
        values = {v.key: v.value for v in reports[-1].values} if reports else {}
        return {k: values.get(f'Samples {k}', '') for k in expected}

    expected = {'not finite': '2', 'out of range': '1', 'duplicate': '1', 'out of order': '1'}
    assert chain.wait(lambda: counts() == expected), counts()
    assert len(chain.got['estimate']) == sent
    kept = {k: np.delete(v, list(bad)) for k, v in columns.items()}
    result = run(kept, Settings.for_mode('paper'))
    assert [m.xi2 for m in chain.got['estimate']] == result.estimates['xi2'].tolist()


@pytest.mark.parametrize(
    ('signal', 'value', 'ne107'),
    [  # IN-1, IN-2
        ('x1', float('nan'), 'failure'),
        ('cv', 55.0, 'out of specification'),
    ],
)
def test_lasting_bad_input_is_told_as_a_failed_sensor(chain, signal, value, ne107):
    columns = {name: column[:1] for name, column in moving_stem(1).items()}
    chain.send_columns(columns)
    assert chain.wait(lambda: chain.got['estimate'])
    good = {'cv': columns['cv'][-1].item(), 'x1': columns['x1'][-1].item()}

    def told() -> list:
        return [s for m in chain.got['/diagnostics'] for s in m.status if 'estimator' in s.name]

    stamp = int(columns['stamp'][-1])
    for n in range(1640):  # 4.1 s
        stamp += PERIOD
        chain.send(stamp, **{**good, signal: value})
        if n % 40 == 0:
            chain.wait(lambda: False, 0.05)  # no faster than a busy machine takes them
    assert chain.wait(lambda: any('input has failed' in s.message for s in told()))
    status = next(s for s in told() if 'input has failed' in s.message)
    assert status.level == DiagnosticStatus.ERROR
    assert f'{signal} = {value:g}' in status.message
    assert 'check' in status.message
    assert {v.key: v.value for v in status.values}['NE 107'] == ne107
    assert chain.wait(lambda: chain.got['fault_flag'][-1].state == FaultFlag.STATE_NOT_MONITORING)
    assert chain.got['fault_flag'][-1].level != FaultFlag.NE107_NORMAL
    assert not chain.got['fault_flag'][-1].fault
    before = len(chain.got['estimate'])
    chain.send(stamp + PERIOD, **good)
    assert chain.wait(lambda: len(chain.got['estimate']) == before + 1), 'no recovery'
    assert chain.wait(lambda: 'input has failed' not in told()[-1].message)


def test_a_late_subscriber_gets_the_last_flag_at_once(chain):
    chain.send_columns(moving_stem(600))
    late = chain.listen(FaultFlag, 'fault_flag', qos.FLAG)
    began = time.monotonic()
    assert chain.wait(lambda: late)
    assert time.monotonic() - began < promised(0.9), 'came with the next heartbeat only'
    assert late[0].header.frame_id == 'LC74_20'


def test_silence_is_not_health(chain):
    flags = chain.got['fault_flag']
    stamps = itertools.count(0, PERIOD)

    def healthy() -> bool:
        chain.send(next(stamps), 0.5, 0.5)  # until it is seen: it lasts no longer than the samples
        return any(f.state == FaultFlag.STATE_HEALTHY for f in flags)

    assert chain.wait(healthy)
    assert chain.wait(lambda: flags[-1].state == FaultFlag.STATE_NOT_MONITORING)


@pytest.mark.parametrize('name', ['estimator', 'detector'])
def test_a_node_alone_says_what_it_waits_for(processes, name):
    processes.start('damadics_fd', name, parameters(mode='paper'))
    deadline = time.monotonic() + PATIENCE
    while 'waiting for' not in processes.log(name).read_text() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert 'ros2 run' in processes.log(name).read_text()
    processes.end(name)


@pytest.mark.parametrize('name', ['estimator', 'detector', 'recorder', 'plant', 'dashboard'])
@pytest.mark.parametrize(
    'numbers',
    [
        (signal.SIGINT,),
        (signal.SIGTERM,),
        (signal.SIGINT, signal.SIGINT),
    ],
    ids=['Ctrl-C', 'kill', 'launch'],
)  # launch passes a Ctrl-C on that has reached the node before
def test_signals_end_a_node_with_exit_code_0(domain, tmp_path, name, numbers):
    arguments = {
        'recorder': ['--all', '--out', str(tmp_path / 'bag')],
        'dashboard': ['--port', str(free_port()), '--state', str(tmp_path)],
    }.get(name, [])
    package = {'plant': 'damadics_plant', 'dashboard': 'damadics_dashboard'}.get(
        name, 'damadics_fd'
    )
    process = subprocess.Popen(
        [executable(package, name), *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env={k: v for k, v in {**os.environ, **SPEAK_AT_ONCE}.items() if k != PYTEST},
    )
    try:
        assert process.stdout.readline(), 'the node did not start'
        for number in numbers:
            process.send_signal(number)
            time.sleep(0.005)
        began = time.monotonic()
        assert process.wait(PATIENCE) == 0
        assert time.monotonic() - began < promised(4.0 if name == 'dashboard' else 2.0)
    finally:
        process.kill()


@pytest.mark.parametrize('name', ['estimator', 'detector'])
def test_all_mistakes_in_the_parameters_are_listed(domain, name):
    wrong = parameters(mode='paper', k1=-1.0, tau=0, no_such='x', decide_m='two')
    done = subprocess.run(
        [executable('damadics_fd', name), *wrong], capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 2
    for cause in (
        'k1: -1.0 is not within',
        'tau: 0 is not a number with a decimal point',
        'no_such: there is no such parameter',
        "decide_m: 'two' is not",
    ):
        assert cause in done.stderr


@pytest.mark.parametrize(
    ('words', 'says'),
    [
        (['-p', 'use_sim_time:=5'], 'use_sim_time'),
        (['--params-file', 'nofile.yaml'], 'nofile.yaml'),
        (['-r', '__ns:=not a name'], 'not a name'),
    ],
    ids=['use_sim_time', 'no file', 'namespace'],
)
@pytest.mark.parametrize('name', ['detector', 'plant'])
def test_what_ros_itself_refuses_is_one_line_and_no_restart(domain, name, words, says):
    package = 'damadics_plant' if name == 'plant' else 'damadics_fd'
    done = subprocess.run(
        [executable(package, name), '--ros-args', *words],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 2, done.stderr
    assert says in done.stderr
    assert 'Traceback' not in done.stderr and len(done.stderr.splitlines()) <= 5


def test_the_plant_takes_the_file_of_a_valve_as_it_is(domain, tmp_path):
    file = tmp_path / 'lv101.yaml'
    values = ('actuator: LV-101', 'stroke: 0.05', 'sample_rate: 200.0')
    settings = '\n    '.join(['/**:\n  ros__parameters:', *values]) + '\n'
    file.write_text(settings)
    done = run_plant(file)
    assert done.returncode == 0, done.stderr
    assert 'sample_rate, stroke: for monitors' in done.stderr
    assert 'model dablib, 400 Hz' in done.stderr

    constants = ('mass: 6.0', 'stiffness: 9.0e4', 'area: 0.035', 'dead_volume: 6.0e-3')
    twin = (*values, *constants, 'supply: 6.0e5', 'coulomb: 200.0')
    file.write_text(
        settings + '\n      '.join(['/**/plant:\n  ros__parameters:\n    twin:', *twin]) + '\n'
    )
    done = run_plant(file)
    assert done.returncode == 0, done.stderr
    assert 'valve LV-101, 200 Hz' in done.stderr
    assert 'for monitors' not in done.stderr

    file.write_text(file.read_text().replace('coulomb', 'coulom'))
    done = run_plant(file)
    assert done.returncode == 2
    assert 'coulom is no constant of the model; coulomb is missing' in done.stderr
    done = run_plant(file, 'strok:=1.0')
    assert done.returncode == 2
    assert 'strok: there is no such parameter' in done.stderr


def run_plant(file, *more):
    words = ['duration:=0.5', 'real_time_factor:=0.0', *more]
    given = [word for one in words for word in ('-p', one)]
    return subprocess.run(
        [executable('damadics_plant', 'plant'), '--ros-args', '--params-file', str(file), *given],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
