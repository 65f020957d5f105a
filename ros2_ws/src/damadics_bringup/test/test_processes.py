# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
import socket
import time

import pytest
from damadics_bringup.processes import (
    ProcessError,
    Processes,
    assignments,
    executable,
    free_domain,
    parameters,
)


def test_parameters_are_written_as_ros_takes_them():
    assert parameters(mode='paper', rate=400.0, noise=True) == [
        '--ros-args',
        '-p',
        'mode:=paper',
        '-p',
        'rate:=400.0',
        '-p',
        'noise:=true',
    ]


def test_a_text_stays_a_text():
    given = {'alarm_folder': '', 'actuator': '101', 'mode': 'paper', 'limits': [1.0, 2.5]}
    assert assignments(given)[1::2] == [
        'alarm_folder:=""',
        'actuator:="101"',
        'mode:=paper',
        'limits:=[1.0, 2.5]',
    ]


def test_a_missing_executable_names_the_remedy():
    with pytest.raises(ProcessError, match='run make build'):
        executable('damadics_fd', 'no_such_node')
    with pytest.raises(ProcessError, match='run make build'):
        executable('no_such_package', 'detector')


@pytest.mark.parametrize('port', [0, 10, 13])  # of all; of those who stay on this machine
def test_a_domain_in_use_is_not_chosen(port):
    first = free_domain()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as held:
        held.bind(('127.0.0.1' if port else '', 7400 + 250 * first + port))
        assert first not in {free_domain() for _ in range(400)}


def script(tmp_path, monkeypatch, text):
    """Make a shell script the executable that Processes starts."""
    path = tmp_path / 'script'
    path.write_text(text)
    path.chmod(0o755)
    monkeypatch.setattr('damadics_bringup.processes.executable', lambda package, name: path)


def test_a_process_that_fails_is_reported_with_its_output(tmp_path, monkeypatch):
    script(tmp_path, monkeypatch, '#!/bin/sh\necho the valve is gone\nexit 5\n')
    with Processes(tmp_path / 'logs') as processes:
        processes.start('any', 'failing')
        while not processes.ended('failing'):
            pass
        with pytest.raises(ProcessError, match=r'(?s)exit code 5.*the valve is gone'):
            processes.end('failing')


def test_a_process_that_ignores_signals_is_killed(tmp_path, monkeypatch):
    script(tmp_path, monkeypatch, '#!/bin/bash\ntrap "" INT\necho ready\nsleep 60\n')
    with Processes(tmp_path / 'logs') as processes:
        processes.start('any', 'stubborn')
        while 'ready' not in processes.log('stubborn').read_text():
            pass
        with pytest.raises(ProcessError, match='did not end within'):
            processes.end('stubborn', patience=0.3)
        assert processes.ended('stubborn')


def test_all_processes_end_at_the_same_time_and_none_is_left(tmp_path, monkeypatch):
    script(
        tmp_path,
        monkeypatch,
        '#!/bin/bash\n[ $1 = no ] && trap "" INT\necho ready\nexec sleep 60\n',
    )
    stubborn = [f'stubborn {n}' for n in range(6)]
    with Processes(tmp_path / 'logs') as processes:
        for label in (*stubborn, 'obedient'):
            processes.start('any', 'script', ['no' if label in stubborn else 'yes'], label)
        while any('ready' not in processes.log(n).read_text() for n in (*stubborn, 'obedient')):
            pass
        began = time.monotonic()
        killed = processes.end_all(patience=0.5, patient_with={'stubborn 0': 0.7})
        assert time.monotonic() - began < 2 * 0.7, 'one after the other'
        assert sorted(killed) == stubborn
        assert all(processes.ended(label) for label in (*stubborn, 'obedient'))


def test_the_patience_ends_when_somebody_is_in_a_hurry(tmp_path, monkeypatch):
    script(tmp_path, monkeypatch, '#!/bin/bash\ntrap "" INT\necho ready\nsleep 60\n')
    with Processes(tmp_path / 'logs') as processes:
        processes.start('any', 'stubborn')
        while 'ready' not in processes.log('stubborn').read_text():
            pass
        assert processes.end_all(patience=60.0, hurry=lambda: True) == ['stubborn']
