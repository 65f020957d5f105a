# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes listen on sockets, unless the user has chosen, and messages may wait there."""

import fcntl
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from damadics_fd.ros.process import sockets
from damadics_fd.ros.process.sockets import (
    HERE,
    PROFILES,
    SOCKETS,
    TRANSPORTS,
    let_messages_wait,
    listen_on_sockets,
)


@pytest.fixture(autouse=True)
def nothing_is_chosen(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in (PROFILES, TRANSPORTS):
        monkeypatch.setenv(name, '')  # as if it were not there, and put back after the test


def test_sockets_where_nothing_is_chosen():
    listen_on_sockets()
    assert os.environ[PROFILES] == str(SOCKETS)
    assert SOCKETS.exists()


@pytest.mark.parametrize('name', [PROFILES, TRANSPORTS])
def test_what_the_environment_chooses_stays(monkeypatch, name):
    monkeypatch.setenv(name, 'mine')
    listen_on_sockets()
    assert os.environ[PROFILES] == ('mine' if name == PROFILES else '')


def test_a_file_of_profiles_in_the_folder_is_the_users():
    Path(HERE).touch()
    listen_on_sockets()
    assert os.environ[PROFILES] == ''


def room(listening: socket.socket) -> int:
    return listening.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)


def test_messages_have_more_room_than_as_a_rule():
    with socket.socket(type=socket.SOCK_DGRAM) as listening:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 10_000)
        before, opened = room(listening), len(list(Path('/proc/self/fd').iterdir()))
        let_messages_wait()
        assert room(listening) > before
        assert len(list(Path('/proc/self/fd').iterdir())) == opened


def test_a_socket_that_has_more_room_keeps_it(monkeypatch):
    monkeypatch.setattr(sockets, 'ROOM', 10_000)
    with socket.socket(type=socket.SOCK_DGRAM) as listening:
        before = room(listening)
        let_messages_wait()
        assert room(listening) == before


def test_a_locked_file_stays_locked(tmp_path):
    """A closed copy of its descriptor took the lock of a database away: two wrote into one."""
    file = tmp_path / 'locked'
    other = f"import fcntl; fcntl.lockf(open({str(file)!r}, 'a'), fcntl.LOCK_EX | fcntl.LOCK_NB)"
    with file.open('a') as locked:
        fcntl.lockf(locked, fcntl.LOCK_EX)
        let_messages_wait()
        tried = subprocess.run([sys.executable, '-c', other], capture_output=True, text=True)
        assert 'BlockingIOError' in tried.stderr
