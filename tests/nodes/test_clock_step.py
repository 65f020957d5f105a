# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The system clock is set back by an hour, as a time server or a person may do."""

import struct
import subprocess
import time
from pathlib import Path

import pytest
from conftest import PATIENCE, promised
from damadics_bringup.processes import Processes, parameters, surroundings
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultFlag
from diagnostic_msgs.msg import DiagnosticArray
from driven_valve import wait_until_monitored
from rclpy.qos import QoSProfile

pytestmark = pytest.mark.ros
SOURCE = Path(__file__).with_name('clock_step.c')
SETTINGS = {'mode': 'paper', 'sample_rate': 100.0}
PERIOD = 10_000_000  # ns
HOUR = 3600.0


@pytest.fixture
def stepped(tmp_path, domain):
    """Processes whose system clock can be set, and how to set it [s]."""
    library, file = tmp_path / 'clock_step.so', tmp_path / 'step'
    subprocess.run(
        ['cc', '-O1', '-shared', '-fPIC', '-o', library, SOURCE, '-ldl', '-pthread'],
        check=True,
        timeout=PATIENCE,
    )
    file.write_bytes(struct.pack('d', 0.0))
    preload = {'LD_PRELOAD': str(library), 'CLOCK_STEP_FILE': str(file)}
    with Processes(tmp_path / 'logs', {**surroundings(domain), **preload}) as processes:
        yield processes, lambda seconds: file.write_bytes(struct.pack('d', seconds))


def told(reports: list[DiagnosticArray], node: str) -> int:
    return sum(
        status.name.startswith(f'{node}:') for report in reports for status in report.status
    )


@pytest.mark.parametrize('step', [-HOUR, HOUR])
def test_silence_is_noticed_when_the_clock_was_set(stepped, peer, step):
    processes, set_clock = stepped
    flags = peer.listen(FaultFlag, 'fault_flag', qos.FLAG)
    reports = peer.listen(DiagnosticArray, '/diagnostics', QoSProfile(depth=100))
    processes.start('damadics_fd', 'estimator', parameters(**SETTINGS))
    processes.start('damadics_fd', 'detector', parameters(alarm_folder='', **SETTINGS))
    wait_until_monitored(peer, flags)
    began = time.monotonic()
    sent = 0
    while sent < 200 or flags[-1].state != FaultFlag.STATE_HEALTHY:
        due = int((time.monotonic() - began) * 1e9) // PERIOD  # as a plant: stamps keep up
        assert due * PERIOD < PATIENCE * 1e9, 'the valve is not monitored'
        for n in range(sent + 1, due + 1):
            peer.send(n * PERIOD, 0.5, 0.5)
            if n == 100:
                set_clock(step)
        sent = max(sent, due)
        peer.wait(lambda: False, PERIOD * 1e-9)
    silent = time.monotonic()
    assert peer.wait(lambda: flags[-1].state == FaultFlag.STATE_NOT_MONITORING)
    assert time.monotonic() - silent < promised(0.5 + 0.3), 'timeout, and one look'
    said = len(reports)
    for node in ('estimator', 'detector'):
        assert peer.wait(lambda node=node: told(reports[said:], node) >= 2), f'{node} is silent'
