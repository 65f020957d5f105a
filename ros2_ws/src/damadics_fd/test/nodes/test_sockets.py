# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who is started where a process was killed listens on sockets."""

import fcntl
import os
from pathlib import Path

import pytest
from damadics_fd.ros.process import sockets
from damadics_fd.ros.process.sockets import HERE, PROFILES, SOCKETS, TRANSPORTS, left_by_killed


@pytest.fixture
def killed(tmp_path, monkeypatch):
    """Process of domain 3 that was killed, and an environment in which nothing is chosen."""
    for name in (PROFILES, TRANSPORTS):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv('ROS_DOMAIN_ID', '3')
    monkeypatch.setattr(sockets.left_by_killed, '__defaults__', (tmp_path,))
    monkeypatch.chdir(tmp_path)
    lock = tmp_path / 'fastrtps_port8161_el'
    lock.touch()
    return lock


def chosen() -> str | None:
    sockets.over_sockets_after_a_kill()
    return os.environ.get(PROFILES)


def test_sockets_where_a_process_of_the_domain_was_killed(killed):
    assert SOCKETS.exists()
    assert chosen() == str(SOCKETS)


def test_memory_as_ever_while_the_process_lives(killed):
    with killed.open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        assert chosen() is None


@pytest.mark.parametrize('domain', ['2', '4', '', 'x'])
def test_memory_as_ever_in_other_domains(killed, monkeypatch, domain):
    monkeypatch.setenv('ROS_DOMAIN_ID', domain)
    assert chosen() is None


def test_no_domain_stated_is_domain_0(killed, monkeypatch):
    monkeypatch.delenv('ROS_DOMAIN_ID')
    killed.rename(killed.with_name('fastrtps_port7411_el'))
    assert chosen() == str(SOCKETS)


def test_what_cannot_be_opened_is_taken_for_left(tmp_path):
    lock = tmp_path / 'fastrtps_port7411_el'
    lock.symlink_to(lock)
    assert left_by_killed(0, tmp_path) == [lock]


@pytest.mark.parametrize('name', [PROFILES, TRANSPORTS])
def test_what_the_environment_chooses_stays(killed, monkeypatch, name):
    monkeypatch.setenv(name, 'mine')
    assert chosen() == ('mine' if name == PROFILES else None)


def test_a_file_of_profiles_in_the_folder_is_the_users(killed):
    Path(HERE).touch()
    assert chosen() is None
