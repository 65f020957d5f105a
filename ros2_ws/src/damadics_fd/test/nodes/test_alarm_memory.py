# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What becomes of the alarm of before when a detector starts."""

import json
import os
from pathlib import Path
from types import SimpleNamespace

import pytest
from damadics_fd.core.decision.alarm import STATE_LATCHED, STATE_UNKNOWN
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.settings import Settings
from damadics_fd.nodes.alarm_memory import AlarmMemory
from damadics_fd.store.slots import read_slots, slot_file, write_slot

SETTINGS = Settings.for_mode('monitor')
SECOND = 10**9
ALARM = {'latched': True, 'flag': True, 'occurrence': 7, 'worst': 2, 'stamp': 50 * SECOND}
FORMAT = 'damadics_fd alarm 2'


class Log:
    """What a node would have logged."""

    def __init__(self):
        self.lines = []

    def info(self, text, **_):
        self.lines.append(text)

    error = warning = info


def memory(path, **state):
    log = Log()
    core = Detector(SETTINGS)
    if state:
        write_slot(path, FORMAT, {**core.save(), **state}, both=True)
    return AlarmMemory(SimpleNamespace(get_logger=lambda: log), core, path), core, log


@pytest.fixture
def path(tmp_path):
    return tmp_path / 'lv101.alarm'


def test_an_alarm_is_taken_up(path):
    kept, core, _ = memory(path, **ALARM)
    assert kept.restore()
    assert (core.decision.state, core.decision.occurrence) == (STATE_LATCHED, 7)


def test_nothing_kept_is_a_fresh_start(path):
    kept, core, _ = memory(path)
    assert not kept.restore()
    assert core.decision.state != STATE_UNKNOWN


@pytest.mark.parametrize(
    'change',
    [
        {'occurrence': -1},
        {'occurrence': 2**33},
        {'shelved_until': 2**62},
        {'latched': 'yes'},
        {'latched': False},
        {'more': 1},
    ],
    ids=str,
)
def test_values_that_cannot_be_are_a_loss_also_with_a_good_hash(path, change):
    kept, core, log = memory(path, **{**ALARM, **change})
    assert kept.restore()
    assert core.decision.state == STATE_UNKNOWN
    assert 'lost' in log.lines[0]
    assert len(kept.values['Alarm state kept aside'].split()) == 2
    again, core, _ = memory(path)
    assert again.restore()
    assert core.decision.state == STATE_UNKNOWN, 'a restart is no confirmation'


def test_an_alarm_of_another_run_is_a_loss_and_its_files_are_kept(path):
    kept, core, _ = memory(path, **ALARM)
    kept.restore()
    kept.begin(60 * SECOND)
    assert core.decision.state == STATE_LATCHED, 'the run goes on'
    kept, core, _ = memory(path, **ALARM)
    kept.restore()
    kept.begin(SECOND)
    assert core.decision.state == STATE_UNKNOWN
    aside = kept.values['Alarm state kept aside'].split()
    old = [json.loads(Path(file).read_text())['content'] for file in aside]
    assert [state['occurrence'] for state in old] == [7, 7]


def test_another_run_without_an_alarm_begins_afresh(path):
    kept, core, _ = memory(path, stamp=50 * SECOND, occurrence=3)
    kept.restore()
    kept.begin(SECOND)
    assert core.decision.state != STATE_UNKNOWN
    assert core.save()['occurrence'] == 0


def test_one_damaged_copy_is_told_and_mended(path):
    kept, core, log = memory(path, **ALARM)
    file = read_slots(path, FORMAT)[0].file
    file.write_text('{')
    assert kept.restore()
    assert core.decision.state == STATE_LATCHED
    assert any('one of two copies' in line for line in log.lines)
    assert all(not slot.problem for slot in read_slots(path, FORMAT))


def link(target):
    """Return what puts a link in the place of a file."""

    def put(file):
        file.unlink()
        file.symlink_to(target or file)

    return put


def folder(file):
    file.unlink()
    file.mkdir()


def changed(**state):
    """Return what changes a state but not the hash, as a person with an editor does."""

    def change(file):
        document = json.loads(file.read_text())
        document['content'].update(state)
        file.write_text(json.dumps(document))

    return change


DAMAGE = {  # A2: each of them turned the valve green once
    'cut in half': lambda file: os.truncate(file, file.stat().st_size // 2),
    'last byte': lambda file: os.truncate(file, file.stat().st_size - 1),
    'empty': lambda file: os.truncate(file, 0),
    'zeroed': lambda file: file.write_bytes(bytes(file.stat().st_size)),
    'nested': lambda file: file.write_text('[' * 100_000),
    'a number of 5000 digits': lambda file: file.write_text('{"number": ' + '9' * 5000 + '}'),
    'a list': lambda file: file.write_text('[1, 2]'),
    'another text': lambda file: file.write_bytes(b'\xff\xfe' + bytes(range(256))),
    'a folder': folder,
    'a loop': link(None),
    'nothing': link('/dev/null'),
    'nowhere': link('/nowhere/at/all'),
    'not latched': changed(latched=False, flag=False),
    'never raised': changed(occurrence=0),
    'acknowledged': changed(acknowledged=True),
    'one field more': changed(more=1.0),
    'no number': changed(worst=float('inf')),
}


@pytest.mark.parametrize('second', [None, 'empty'], ids=['both the same', 'the other is empty'])
@pytest.mark.parametrize('damage', DAMAGE)
def test_no_damage_of_both_copies_turns_an_alarm_green(path, damage, second):
    kept, core, _ = memory(path, **ALARM)
    files = [slot_file(path, name) for name in ('a', 'b')]
    for file, how in zip(files, (damage, second or damage), strict=True):
        DAMAGE[how](file)
    kept, core, log = memory(path)
    assert kept.restore() and core.decision.state == STATE_UNKNOWN
    assert any('lost' in line for line in log.lines)
    kept, core, _ = memory(path)
    assert kept.restore() and core.decision.state == STATE_UNKNOWN, 'a restart confirms nothing'
    aside = [each.name for each in path.parent.iterdir() if '.bad-' in each.name]
    assert len(aside) >= 2, 'a person can look at what there was'


@pytest.mark.parametrize('name', ['a', 'b'])
@pytest.mark.parametrize('damage', DAMAGE)
def test_damage_of_one_copy_loses_nothing(path, damage, name):
    memory(path, **ALARM)
    DAMAGE[damage](slot_file(path, name))
    kept, core, log = memory(path)
    assert kept.restore()
    assert (core.decision.state, core.decision.occurrence) == (STATE_LATCHED, 7)
    assert any('one of two copies' in line for line in log.lines)
    assert all(not slot.problem for slot in read_slots(path, FORMAT)), 'and it is mended'
