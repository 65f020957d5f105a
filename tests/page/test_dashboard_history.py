# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The history of the page: kept over restarts, damage and a locked file."""

import sqlite3

import pytest
from alarm_events import event
from damadics_dashboard.live.unseen import Unseen
from damadics_dashboard.store.history import History, Wanted
from damadics_dashboard.words.texts import texts
from damadics_dashboard.words.valve_words import history_rows
from damadics_fd.store.access import Access, Grant, Role
from damadics_msgs.msg import FaultEvent

TOKEN = '0123456789abcdef'
OPERATOR = Access([Grant(Role.OPERATOR, TOKEN)])


def test_history_survives_and_takes_a_repeated_event_once(tmp_path):
    path = tmp_path / 'state' / 'history.sqlite'
    first = History(path)
    assert first.add(event(FaultEvent.RAISED))
    assert first.add(event(FaultEvent.CLEARED, 'cleared'))
    first.close()
    second = History(path)
    assert not second.add(event(FaultEvent.RAISED)), 'the detector repeats it to a newcomer'
    assert second.add(event(FaultEvent.RAISED)), 'the same run again is another event'
    assert [row['transition'] for row in second.latest()] == [0, 1, 0]
    assert second.valves() == ['lv101']
    second.close()


def test_a_history_of_before_gets_what_it_lacks_and_keeps_its_rows(tmp_path):
    path = tmp_path / 'history.sqlite'
    first = History(path)
    first.add(event(FaultEvent.RAISED))
    first.close()
    with sqlite3.connect(path) as database:
        database.execute('ALTER TABLE event DROP COLUMN unseen')
    second = History(path)
    assert not second.problem
    second.add({**event(FaultEvent.CLEARED, 'cleared'), 'unseen': 120.0})
    assert [row['unseen'] for row in second.latest()] == [120.0, None]
    second.close()


def test_time_without_data_is_told_beside_how_long_an_alarm_lasted():
    unseen, second = Unseen(), 10**9
    for t in [*range(100), *range(220, 306)]:  # the driver is gone for two minutes
        unseen.judged(t * second, 1 if t >= 50 else 0, present=t >= 50)
    end = event(FaultEvent.CLEARED, stamp=306 * second) | {'duration': 256.0}
    unseen.tell(end)
    assert end['unseen'] == 121.0
    (row,) = history_rows([end], texts('en'))
    assert row['text'] == 'It lasted 4 min 16 s, 2 min 1 s of it without data.'
    unseen.judged(307 * second, 1, present=False)
    unseen.judged(500 * second, 2, present=True)
    assert unseen.seconds == 0.0, 'it was no alarm, then'


@pytest.mark.parametrize('period', [0.1, 1.0, 10.0])
def test_a_slow_valve_is_not_unseen(period):
    unseen = Unseen()
    for n in range(1, 100):
        unseen.judged(round(n * period * 1e9), 1, present=True)
    assert unseen.seconds == 0.0


def test_history_finds_by_word_valve_kind_and_time(tmp_path):
    history = History(tmp_path / 'history.sqlite')
    for n in range(5):
        history.add({**event(FaultEvent.RAISED, f'raised {n} 50%', stamp=n), 'valve': f'v{n}'})
    history.add(event(FaultEvent.CLEARED, 'cleared'))
    found = [row['text'] for row in history.find(Wanted(text='raised 3'))]
    assert found == ['raised 3 50%']
    assert len(history.find(Wanted(text='50%'))) == 5 and not history.find(Wanted(text='5_%'))
    assert len(history.find(Wanted(valve='v1'))) == 1
    assert len(history.find(Wanted(transitions=(FaultEvent.CLEARED,)))) == 1
    assert not history.find(Wanted(until=1.0))
    assert len(history.find(Wanted(), 2, 4)) == 2
    history.close()


def test_what_people_did_is_kept_once_though_page_and_node_tell_it(tmp_path):
    history = History(tmp_path / 'history.sqlite')
    action = {'valve': 'v', 'action': 'reset', 'user': 'Anna', 'role': 'operator'}
    action |= {'comment': 'packing', 'done': 1, 'result': 'reset'}
    assert history.add_action(action)
    assert not history.add_action({**action, 'role': ''}, 5), 'the node says it again'
    assert not history.add_action({**action, 'role': ''}, 5), 'and after its restart'
    assert [row['user'] for row in history.actions()] == ['Anna']
    assert history.add_action({**action, 'role': ''}, 9), 'she did it again, not on the page'
    assert history.add_action({**action, 'role': ''}, 12)
    history.close()
    again = History(tmp_path / 'history.sqlite')
    assert len(again.actions()) == 3
    for stamp in (5, 9, 12):
        assert not again.add_action({**action, 'role': ''}, stamp), 'told to a newcomer'
    assert again.add_action({**action, 'role': ''}, 15)
    again.close()


def test_a_locked_history_waits_in_memory_and_is_written_later(tmp_path):
    path = tmp_path / 'history.sqlite'
    history = History(path)
    holder = sqlite3.connect(path)
    holder.execute('BEGIN IMMEDIATE')
    assert history.add(event(FaultEvent.RAISED))
    assert 'tried again' in history.problem
    holder.rollback()
    history.retry()
    assert history.problem == '' and len(history.latest()) == 1
    history.close()


@pytest.mark.parametrize('content', [b'garbage' * 99, b'SQLite format 3\0' + bytes(5000), None])
def test_a_damaged_history_is_moved_aside_and_begun_anew(tmp_path, content):
    path = tmp_path / 'history.sqlite'
    if content is None:
        path.mkdir()
    else:
        path.write_bytes(content)
    history = History(path)
    assert 'the file of before is' in history.problem
    assert history.add(event(FaultEvent.RAISED)) and len(history.latest()) == 1
    assert len(list(tmp_path.glob('history.sqlite.bad-*'))) == 1
    history.close()


def test_a_history_whose_description_is_no_text_is_moved_aside_each_time_under_a_name(tmp_path):
    path = tmp_path / 'history.sqlite'
    for _ in range(2):  # in one second
        History(path).close()
        whole = path.read_bytes()
        path.write_bytes(whole.replace(b'CREATE TABLE event', b'CREATE TABLE \xff\xae\xffnt'))
        for journal in tmp_path.glob('*-*l'):
            journal.unlink()
        History(path).close()
    assert len(list(tmp_path.glob('history.sqlite.bad-*'))) == 2


def test_damaged_rows_of_a_history_are_left_out_and_told(tmp_path):
    path = tmp_path / 'history.sqlite'
    history = History(path)
    history.add(event(FaultEvent.RAISED, 'whole'))
    history.add(event(FaultEvent.RAISED, 'text'))
    history.add(event(FaultEvent.RAISED, 'stamp'))
    history.close()
    with sqlite3.connect(path) as file:
        file.execute("UPDATE event SET valve = CAST(x'50ff45' AS TEXT) WHERE text = 'text'")
        file.execute("UPDATE event SET stamp = 'yesterday' WHERE text = 'stamp'")
        file.execute("INSERT INTO event (valve, seen) VALUES (x'ff', 1.0), (NULL, 2.0)")
    history = History(path)
    assert [row['text'] for row in history.latest()] == ['text', 'whole']
    assert all(isinstance(valve, str) for valve in history.valves())
    assert 'P\ufffdE' in history.valves()
    assert 'left out' in history.problem
    history.close()
