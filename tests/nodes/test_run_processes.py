# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""`run` and its children: they end together, and what cannot run is told instead of repeated."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import PATIENCE, children, ended
from damadics_bringup.keeper import Keeper, Task
from damadics_bringup.processes import Processes, executable

pytestmark = pytest.mark.ros
LONG = ['sleep', '600']


def alive(number: int) -> bool:
    try:
        state = Path(f'/proc/{number}/stat').read_text().rpartition(') ')[2][0]
    except OSError:
        return False
    return state != 'Z'


def wait_for(condition, patience: float = PATIENCE) -> bool:
    deadline = time.monotonic() + patience
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return bool(condition())


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGTERM, signal.SIGSEGV])
def test_children_end_with_what_started_them(tmp_path, number):
    begun = subprocess.Popen(
        [
            sys.executable,
            '-c',
            'import sys, time\n'
            'from pathlib import Path\n'
            'from damadics_bringup import processes\n'
            "processes.executable = lambda package, name: '/bin/sleep'\n"
            'p = processes.Processes(Path(sys.argv[1]))\n'
            'p.__enter__()\n'
            "for n in range(3): p.start('x', 'sleep', ['600'], str(n))\n"
            'print(*[p.pid(str(n)) for n in range(3)], flush=True)\n'
            'time.sleep(600)\n',
            str(tmp_path),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    with ended(begun) as parent:
        started = [int(word) for word in parent.stdout.readline().split()]
        assert len(started) == 3
        assert all(map(alive, started))
        parent.send_signal(number)
        parent.wait(PATIENCE)
    assert wait_for(lambda: not any(map(alive, started))), 'they run on'


def test_nodes_end_when_run_is_killed(domain, tmp_path):
    """Nodes of a killed demo ran on for forty minutes."""
    run = subprocess.Popen(
        [executable('damadics_bringup', 'run'), '--simulate', '--logs', str(tmp_path / 'logs')],
        stdout=subprocess.DEVNULL,
    )
    try:
        assert wait_for(lambda: len(children(run.pid)) == 3)
        started = [child.pid for child in children(run.pid)]
        time.sleep(1.0)
    finally:
        run.kill()
        run.wait()
    assert wait_for(lambda: not any(map(alive, started))), 'they run on'


@pytest.mark.parametrize(
    ('words', 'says'),
    [
        (['--dashboard', '--port', '99999'], 'from 1 to 65535'),
        (['--dashboard', '--port', '-1'], 'from 1 to 65535'),
        (['--dashboard', '--port', 'x'], 'from 1 to 65535'),
        (['--dashboard', '--host', '0.0.0.0'], '--token-file'),
        (['--dashboard', '--host', 'no.such.host.invalid'], '--host'),
        (['--dashboard', '--host', '192.0.2.1', '--token-file', '{good}'], 'another --host'),
        (['--dashboard', '--token-file', '{missing}'], 'No such file'),
        (['--dashboard', '--token-file', '{bad}'], 'letters, digits'),
        (['{missing}'], 'No such file'),
        (['--record', '/proc/x/bag'], 'cannot write'),
    ],
    ids=lambda value: ' '.join(value) if isinstance(value, list) else '',
)
def test_what_can_never_start_is_refused_before_anything_is_started(tmp_path, words, says):
    (tmp_path / 'good').write_text('operator ' + 'a' * 32)
    (tmp_path / 'bad').write_text('operator ab+c/d==ab+c/d==ab+c/d==')
    paths = {name: str(tmp_path / name) for name in ('good', 'bad', 'missing')}
    done = subprocess.run(
        [
            executable('damadics_bringup', 'run'),
            *(word.format(**paths) for word in words),
            '--logs',
            str(tmp_path / 'logs'),
        ],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 2
    assert says in done.stderr
    assert 'Traceback' not in done.stderr
    assert done.stdout == '', 'it said that it starts'
    assert not (tmp_path / 'logs').exists()


def test_a_port_in_use_is_told(tmp_path):
    import socket

    with socket.create_server(('127.0.0.1', 0)) as taken:
        done = subprocess.run(
            [
                executable('damadics_bringup', 'run'),
                '--dashboard',
                '--port',
                str(taken.getsockname()[1]),
            ],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
    assert done.returncode == 2
    assert 'Address already in use' in done.stderr


def test_wrong_parameters_of_a_valve_are_told_once_and_end_the_run(domain, tmp_path):
    fleet = tmp_path / 'fleet.yaml'
    fleet.write_text('valves: {lv1: {settings: {k1: -1.0}}}')
    done = subprocess.run(
        [executable('damadics_bringup', 'run'), str(fleet), '--logs', str(tmp_path / 'logs')],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 2
    assert done.stderr.count('cannot run as it is') == 2
    assert 'k1: -1.0 is not within' in done.stderr
    assert 'again in' not in done.stderr


def test_a_crash_is_started_again_and_a_refusal_is_not(tmp_path, monkeypatch):
    script = tmp_path / 'script'
    script.write_text('#!/bin/sh\necho "went\033[31m wrong"\nexit $1\n')
    script.chmod(0o755)
    monkeypatch.setattr('damadics_bringup.processes.executable', lambda package, name: str(script))
    tasks = [Task(f'ends_{code}', 'x', 'x', [str(code)]) for code in (1, 2)]
    with Processes(tmp_path / 'logs') as processes:
        keeper = Keeper(processes, tasks)

        def both() -> bool:
            keeper.look()
            again = processes.log('ends_1').read_text().count('wrong') >= 2
            return again and 'ends_2' in keeper.refused

        assert wait_for(both)
        wait_for(lambda: keeper.look(), 1.0)  # what is refused stays so
    assert keeper.refused == {'ends_2'}
    assert processes.log('ends_2').read_text().count('wrong') == 1
    assert processes.log('ends_1').read_text().count('wrong') >= 2
    assert not keeper.hopeless


def test_another_middleware_gets_a_sentence_with_the_remedy(domain):
    done = subprocess.run(
        [executable('damadics_fd', 'detector')],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        env={**os.environ, 'RMW_IMPLEMENTATION': 'rmw_zenoh_cpp'},
    )
    assert done.returncode == 2
    assert 'unset RMW_IMPLEMENTATION' in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_an_interrupt_while_it_imports_leaves_no_traceback(domain):
    begun = subprocess.Popen(
        [executable('damadics_fd', 'detector')], stderr=subprocess.PIPE, text=True
    )
    with ended(begun) as process:
        maps = Path(f'/proc/{process.pid}/maps')
        assert wait_for(lambda: 'numpy' in maps.read_text())
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE)
    assert 'Traceback' not in said


@pytest.mark.skipif(os.geteuid() != 0, reason='only root can become another user')
@pytest.mark.parametrize('home', [None, '/root'])
def test_a_user_who_can_write_nowhere_starts_a_node(domain, home):
    environment = {name: value for name, value in os.environ.items() if name != 'XDG_STATE_HOME'}
    environment.pop('HOME', None)
    if home:
        environment['HOME'] = home
    done = subprocess.run(
        [
            'setpriv',
            '--reuid=65534',
            '--regid=65534',
            '--clear-groups',
            sys.executable,
            '-c',
            'from damadics_fd.ros.arguments import state_folder\n'
            'from damadics_fd.store.slots import check_folder\n'
            'from damadics_fd.core.decision.alarm import severity\n'
            'print(severity(3), check_folder(state_folder()))',
        ],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        env=environment,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == '4 \n'
    assert len(done.stderr.splitlines()) <= 2
    assert 'compiled code' in done.stderr
