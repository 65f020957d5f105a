# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How long a process of a demonstration may be held up before Fast DDS takes it for dead."""

import os
import struct
from pathlib import Path

import pytest
from conftest import Peer
from damadics_bringup.live_run import PATIENT, LiveRun, not_dead_when_held_up
from damadics_fd.ros import qos
from damadics_fd.ros.process.sockets import HERE, PROFILES, TRANSPORTS
from damadics_msgs.msg import FaultFlag

pytestmark = pytest.mark.ros
TEN_SECONDS = 10_000  # ms
PORT = '/dev/shm/fastrtps_port'


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in (PROFILES, TRANSPORTS):
        monkeypatch.setenv(name, '')  # as if it were not there, and put back after a run


def held_up_for(number: int) -> list[int]:
    """Return how long the memory lives in which a process listens [ms], as Fast DDS keeps it."""
    lines = Path(f'/proc/{number}/maps').read_text().splitlines()
    found = []
    for file in {Path(line.split()[-1]) for line in lines if line.split()[-1].startswith(PORT)}:
        content, port = file.read_bytes(), int(file.name.removeprefix('fastrtps_port'))
        at = content.find(struct.pack('<II', port, 1))  # the port and its one listener
        if at >= 0:
            found += struct.unpack_from('<I', content, at + 8)
    return found


def test_it_may_be_held_up_for_ten_seconds(domain, processes):
    """It was taken for dead after one, and heard nothing of a whole experiment any more."""
    processes.start('damadics_fd', 'detector', [], more=not_dead_when_held_up())
    peer = Peer(domain, publishes=False)
    try:
        flags = peer.listen(FaultFlag, '/fault_flag', qos.FLAG)
        assert peer.wait(lambda: flags)
        assert TEN_SECONDS in held_up_for(processes.pid('detector'))
    finally:
        peer.close()


def test_a_run_of_the_demo_is_allowed_it(domain, tmp_path):
    run = LiveRun('paper_nominal', tmp_path / 'run', tmp_path / 'none', print, recorded=False)
    run.close()
    assert os.environ[PROFILES] == str(PATIENT)


@pytest.mark.parametrize('name', [PROFILES, TRANSPORTS])
def test_what_the_environment_chooses_stays(monkeypatch, name):
    monkeypatch.setenv(name, 'mine')
    assert not_dead_when_held_up() == {}


def test_a_file_of_profiles_in_the_folder_is_the_users():
    Path(HERE).touch()
    assert not_dead_when_held_up() == {}
