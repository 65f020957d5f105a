# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""AM-7, PR-2: an alarm survives a restart, and what is lost is told as lost."""

import contextlib
import errno
import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.settings import Settings
from damadics_fd.store.alarms import FORMAT, FORMAT_0_1, AlarmStore, LostAlarmError
from damadics_fd.store.slots import read_slots

STATE = Detector(Settings.for_mode('monitor')).save()
ALARM = {**STATE, 'active': True, 'latched': True, 'flag': True, 'occurrence': 7, 'worst': 2}


@pytest.fixture
def store(tmp_path):
    store = AlarmStore(tmp_path / 'lv101.alarm')
    store.save(ALARM)
    assert store.problem == ''
    return store


def test_nothing_kept_is_no_loss(tmp_path):
    assert AlarmStore(tmp_path / 'x.alarm').load() is None


def test_one_damaged_copy_loses_nothing_and_is_told(store):
    for slot in read_slots(store.path, FORMAT):
        whole = slot.file.read_bytes()
        slot.file.write_bytes(whole[: len(whole) // 2])
        kept = AlarmStore(store.path).load()
        assert kept.state == ALARM
        assert str(slot.file) in kept.problem
        slot.file.write_bytes(whole)


def test_two_damaged_copies_are_a_loss_never_health(store):
    rng = np.random.default_rng(0)
    files = [slot.file for slot in read_slots(store.path, FORMAT)]
    whole = files[0].read_bytes()
    for _ in range(300):
        for file in files:
            damaged = bytearray(whole)
            damaged[rng.integers(len(damaged))] ^= 1 << rng.integers(8)
            file.write_bytes(damaged)
        with contextlib.suppress(LostAlarmError):
            assert AlarmStore(store.path).load().state == ALARM  # white space may change


def test_what_is_set_aside_can_be_read_by_a_person(store, tmp_path):
    for slot in read_slots(store.path, FORMAT):
        slot.file.write_text('damaged')
    with pytest.raises(LostAlarmError):
        AlarmStore(store.path).load()
    assert [path.read_text() for path in store.set_aside()] == ['damaged'] * 2
    with pytest.raises(LostAlarmError):
        AlarmStore(store.path).load()  # a crash now must not make it look like a fresh start
    store.save(ALARM, again=True)
    assert AlarmStore(store.path).load().state == ALARM
    assert len(list(tmp_path.glob('*.bad-*'))) == 2


def test_an_alarm_of_0_1_is_taken_up_and_replaced(tmp_path):
    old = {name: value for name, value in ALARM.items() if name != 'unknown'}
    file = tmp_path / 'lv101.alarm.json'
    file.write_text(json.dumps({'format': FORMAT_0_1, 'state': old}))
    store = AlarmStore(tmp_path / 'lv101.alarm')
    assert store.load().state == old
    store.save(ALARM)
    assert not file.exists()
    assert AlarmStore(store.path).load().state == ALARM


@pytest.mark.parametrize('text', ['', '{}', '{"format": "x"}', '[1', 'null'])
def test_a_damaged_alarm_of_0_1_is_a_loss(tmp_path, text):
    (tmp_path / 'v.alarm.json').write_text(text)
    with pytest.raises(LostAlarmError, match=r'v\.alarm\.json'):
        AlarmStore(tmp_path / 'v.alarm').load()


@pytest.mark.parametrize('full', ['pathlib.Path.open', 'os.fsync'])
def test_what_could_not_be_saved_is_told_and_saved_later(store, monkeypatch, full):
    def no_space(*_, **__):
        raise OSError(errno.ENOSPC, 'No space left on device')

    with monkeypatch.context() as patch:
        patch.setattr(full, no_space)
        store.save({**ALARM, 'acknowledged': True})
    assert 'No space left' in store.problem
    assert AlarmStore(store.path).load().state == ALARM
    store.save({**ALARM, 'acknowledged': True})
    assert store.problem == ''
    assert AlarmStore(store.path).load().state == {**ALARM, 'acknowledged': True}


ANOTHER = """
import json, sys
from pathlib import Path
from damadics_fd.store.alarms import AlarmStore
store = AlarmStore(Path(sys.argv[1]))
kept = store.load()
for state in (json.loads(line) for line in sys.stdin):
    store.save(state)
    print(store.problem, flush=True)
"""


def test_two_processes_of_one_file_lose_no_alarm(store):
    with subprocess.Popen(
        [sys.executable, '-c', ANOTHER, store.path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
        text=True,
    ) as another:

        def save(state: dict) -> str:
            another.stdin.write(json.dumps(state) + '\n')
            another.stdin.flush()
            return another.stdout.readline()

        assert 'another process keeps its alarms' in save(STATE)
        assert AlarmStore(store.path).load().state == ALARM
        shutil.rmtree(store.path.parent)  # with the claims
        store.save({**ALARM, 'acknowledged': True})
        assert store.problem == '' and 'another process' in save(STATE)
        another.kill()
    again = AlarmStore(store.path)
    assert again.load().state == {**ALARM, 'acknowledged': True} and again.problem == ''
