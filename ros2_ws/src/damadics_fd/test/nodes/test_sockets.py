# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Nodes listen on sockets, unless the user has chosen."""

import os
from pathlib import Path

import pytest
from damadics_fd.ros.process.sockets import (
    HERE,
    PROFILES,
    SOCKETS,
    TRANSPORTS,
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
