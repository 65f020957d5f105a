# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What people did at a valve is there after a restart of its node."""

import pytest
from damadics_fd.store.actions import MOST, Act, ActionStore
from damadics_fd.store.slots import slot_file, write_slot


def act(number: int, **more) -> Act:
    given = {'user': 'Anna', 'role': '', 'comment': 'seen', 'done': True, 'result': 'done'}
    return Act(action=0, stamp=number, occurrence=number, **{**given, **more})


def test_the_latest_acts_come_back_in_their_order(tmp_path):
    store = ActionStore(tmp_path / 'lv1.actions')
    assert store.load() == []
    for number in range(MOST + 20):
        store.add(act(number, done=number % 2 == 0))
    again = ActionStore(tmp_path / 'lv1.actions')
    assert again.load() == [act(n, done=n % 2 == 0) for n in range(20, MOST + 20)]
    again.add(act(999))
    assert ActionStore(tmp_path / 'lv1.actions').load()[-1] == act(999)
    assert not again.problem


def test_a_kill_while_writing_loses_the_last_act_at_most(tmp_path):
    store = ActionStore(tmp_path / 'lv1.actions')
    for number in range(4):
        store.add(act(number))
    newest = slot_file(tmp_path / 'lv1.actions', 'b')
    newest.write_bytes(newest.read_bytes()[:-30])
    again = ActionStore(tmp_path / 'lv1.actions')
    assert again.load() == [act(n) for n in range(3)]
    assert 'is lost' in again.problem and len(list(tmp_path.glob('*.bad-*'))) == 1


@pytest.mark.parametrize(
    'change',
    [
        {'stamp': -1},
        {'occurrence': 2**32},
        {'action': 256},
        {'action': '0'},
        {'more': 1},
        {'stamp': 10**400},  # whole, and larger than any float
        {'occurrence': 1.5e300},
    ],
)
def test_values_of_a_file_are_checked_as_those_of_a_request(tmp_path, change):
    row = {**vars(act(1)), **change}
    write_slot(tmp_path / 'a', 'damadics_fd operator actions 1', {'acts': [row]})
    store = ActionStore(tmp_path / 'a')
    assert store.load() == [] and 'damaged' in store.problem


def test_texts_of_a_file_are_cut_and_freed_of_controls(tmp_path):
    rows = [{**vars(act(1)), 'user': 'A\x1b[31m' + 'x' * 5000}]
    write_slot(tmp_path / 'a', 'damadics_fd operator actions 1', {'acts': rows})
    (found,) = ActionStore(tmp_path / 'a').load()
    assert found.user.isprintable() and len(found.user) == 100


def test_a_full_disk_is_told_and_the_next_write_brings_all(tmp_path):
    store = ActionStore(tmp_path / 'f' / 'a')
    (tmp_path / 'f').write_text('in the way')
    store.add(act(1))
    assert 'would not survive' in store.problem
    (tmp_path / 'f').unlink()
    store.add(act(2))
    assert not store.problem
    assert ActionStore(tmp_path / 'f' / 'a').load() == [act(1), act(2)]


def test_nothing_is_kept_where_there_is_no_folder():
    store = ActionStore(None)
    store.add(act(1))
    assert store.load() == [] and not store.problem
