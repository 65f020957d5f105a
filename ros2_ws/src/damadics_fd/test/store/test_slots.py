# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""PR-2: a file that has to survive is read whole and unchanged, or not at all."""

import errno
import hashlib
import json
import os

import pytest
from damadics_fd.store.slots import check_folder, read_slots, set_aside, write_slot
from hypothesis import given, settings
from hypothesis import strategies as st

KIND = 'damadics_fd test 1'
CONTENT = {'active': True, 'peak': 1.5, 'recent': [1, -1], 'text': 'packing', 'deep': {'a': None}}


def contents(path):
    return [slot.content for slot in read_slots(path, KIND) if slot.content is not None]


def problems(path):
    return [slot.problem for slot in read_slots(path, KIND) if slot.problem]


def signed(**changes):
    """Return a file with the hash that belongs to its content."""
    body = {'format': KIND, 'number': 1, 'content': CONTENT, **changes}
    text = json.dumps(body, sort_keys=True, separators=(',', ':'))
    return json.dumps({**body, 'sha256': hashlib.sha256(text.encode()).hexdigest()})


def test_both_slots_hold_the_newest_where_it_matters(tmp_path):
    path = tmp_path / 'v'
    write_slot(path, KIND, {'n': 1}, both=True)
    write_slot(path, KIND, {'n': 2}, both=True)
    assert contents(path) == [{'n': 2}, {'n': 2}]
    write_slot(path, KIND, {'n': 3})
    assert contents(path) == [{'n': 3}, {'n': 2}]
    assert sorted(p.name for p in tmp_path.iterdir()) == ['v.a.json', 'v.b.json']


class Killed(BaseException):
    """The process ends here."""


@pytest.mark.parametrize('both', [True, False])
@pytest.mark.parametrize('before', [[], [{'n': 1}]])
def test_a_kill_while_the_disk_is_waited_for_loses_nothing(tmp_path, monkeypatch, before, both):
    def killed(_):
        raise Killed

    path = tmp_path / 'v'
    for content in before:
        write_slot(path, KIND, content, both=True)
    monkeypatch.setattr('os.fsync', killed)
    with pytest.raises(Killed):
        write_slot(path, KIND, {'n': 2}, both=both)
    assert contents(path) == [{'n': 2}, *before]
    assert not problems(path)


def test_what_is_kept_twice_is_synced_as_are_the_names(tmp_path, monkeypatch):
    synced = []
    sync = os.fsync

    def noted(number):
        synced.append(os.fstat(number).st_ino)
        sync(number)

    monkeypatch.setattr('os.fsync', noted)
    write_slot(tmp_path / 'v', KIND, CONTENT, both=True)
    assert set(synced) == {p.stat().st_ino for p in (tmp_path, *tmp_path.iterdir())}


@settings(deadline=None)  # a busy machine pauses longer than one example may take
@given(st.data())
def test_any_damage_is_noticed(tmp_path_factory, data):
    path = tmp_path_factory.mktemp('slots') / 'v'
    file = write_slot(path, KIND, CONTENT)
    whole = file.read_bytes()
    damaged = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(damaged)))
        length = data.draw(st.integers(0, 40))
        damaged[place : place + length] = data.draw(st.binary(max_size=40))
    file.write_bytes(damaged)
    assert contents(path) in ([], [CONTENT]), 'half of it was read'
    assert contents(path) or problems(path)


@pytest.mark.parametrize(
    'text',
    [
        '',
        '{',
        '[' * 100_000,
        '{"a":' * 100_000,
        '1' * 5000,
        '{"number": NaN}',
        '{"number": Infinity}',
        'null',
        '\x00' * 300,
        json.dumps({'format': KIND, 'number': -5, 'content': {}}),
        json.dumps({'format': KIND, 'number': 10**400, 'content': []}),
        signed(number=9 * 10**4299),  # one more would have too many digits to be written
        signed(number=2**63),
        signed(number=True, content=[]),
    ],
    ids=lambda text: text[:12],
)
def test_hostile_text_is_damage(tmp_path, text):
    (tmp_path / 'v.a.json').write_text(text)
    assert contents(tmp_path / 'v') == []
    assert len(problems(tmp_path / 'v')) == 1
    write_slot(tmp_path / 'v', KIND, CONTENT, both=True)
    assert contents(tmp_path / 'v') == [CONTENT] * 2


@pytest.mark.parametrize('keep', [False, True])
@pytest.mark.parametrize('kind', ['folder', 'loop', 'null', 'zero', 'pipe', 'nothing', 'huge'])
def test_what_is_no_file_is_damage_and_is_replaced(tmp_path, kind, keep):
    file = tmp_path / 'v.a.json'
    make = {
        'folder': file.mkdir,
        'loop': lambda: file.symlink_to(file),
        'null': lambda: file.symlink_to('/dev/null'),
        'zero': lambda: file.symlink_to('/dev/zero'),
        'pipe': lambda: os.mkfifo(file),
        'nothing': lambda: file.symlink_to(tmp_path / 'nowhere'),
        'huge': lambda: os.truncate(os.open(file, os.O_CREAT | os.O_WRONLY), 2**40),
    }
    make[kind]()
    assert len(problems(tmp_path / 'v')) == 1
    aside = set_aside(file, keep)
    assert os.path.lexists(aside)
    assert len(read_slots(tmp_path / 'v', KIND)) == keep, 'what is kept is damaged until replaced'
    write_slot(tmp_path / 'v', KIND, CONTENT, both=True)
    assert contents(tmp_path / 'v') == [CONTENT] * 2


def test_what_is_kept_aside_does_not_fill_the_disk(tmp_path):
    for _ in range(50):
        (tmp_path / 'v.a.json').write_text('x')
        set_aside(tmp_path / 'v.a.json')
    assert len(list(tmp_path.iterdir())) == 20


@pytest.mark.parametrize('number', [errno.ENOSPC, errno.EDQUOT])
def test_a_full_disk_is_no_reason_not_to_start(tmp_path, monkeypatch, number):
    def full(*_, **__):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(type(tmp_path), 'open', lambda self, *_, **__: (self.touch(), full()))
    assert check_folder(tmp_path) == ''
    monkeypatch.undo()
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    assert check_folder(tmp_path / 'new' / 'folder') == ''
    assert list((tmp_path / 'new' / 'folder').iterdir()) == []
    (tmp_path / 'file').write_text('')
    for folder in (tmp_path / 'file' / 'x', '/dev/null/x', '/proc/x'):
        assert str(folder) in check_folder(type(tmp_path)(folder))
