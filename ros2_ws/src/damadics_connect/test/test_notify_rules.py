"""Rules of notifications: who, what, when; debounce and digest."""

from datetime import datetime

import pytest
from damadics_connect.notify.rules import Desk, News, read_rules
from damadics_connect.notify.spool import Spool
from damadics_connect.settings import Section

MONDAY_NOON = datetime(2026, 11, 23, 12, 0)


def news(what='raised', valve='lv1', ne107='failure', area='unit1'):
    return News(valve, valve.upper(), area, what, ne107, 'friction up', '12:00')


def desk_of(**rule):
    problems = []
    config = Section({'rules': [{'to': ['a'], **rule}]}, '', problems)
    sent = []
    desk = Desk(read_rules(config, ('a', 'b')), sent.append)
    assert not problems, problems
    return desk, sent


@pytest.mark.parametrize(
    'rule, told',
    [
        ({}, True),
        ({'classes': ['maintenance']}, False),
        ({'classes': ['failure', 'maintenance']}, True),
        ({'valves': ['lv2', 'LV1']}, True),
        ({'valves': ['fv*']}, False),
        ({'areas': ['unit2']}, False),
        ({'areas': ['unit*']}, True),
        ({'from': '06:00', 'until': '11:59'}, False),
        ({'from': '22:00', 'until': '06:00'}, False),
        ({'from': '11:00', 'until': '01:00'}, True),
        ({'days': ['sat', 'sun']}, False),
        ({'what': ['cleared']}, False),
    ],
)
def test_a_rule_is_for_what_it_says(rule, told):
    desk, sent = desk_of(**rule)
    desk.take(news(), 0.0, MONDAY_NOON)
    assert bool(sent) is told


def test_an_alarm_that_does_not_last_is_not_told_nor_is_its_end():
    desk, sent = desk_of(debounce=10.0)
    desk.take(news(), 0.0, MONDAY_NOON)
    desk.take(news('cleared'), 5.0, MONDAY_NOON)
    desk.look(100.0)
    assert sent == []
    desk.take(news(), 200.0, MONDAY_NOON)
    desk.take(news('changed', ne107='maintenance'), 205.0, MONDAY_NOON)
    desk.look(209.9)
    assert sent == []
    desk.look(210.0)
    assert [m.title for m in sent] == ['[DAMADICS FD] LV1: alarm']
    assert '(maintenance)' in sent[0].body, 'with what is known by then'
    desk.take(news('cleared'), 300.0, MONDAY_NOON)
    assert [m.title for m in sent][1:] == ['[DAMADICS FD] LV1: alarm over']


def test_a_digest_gathers_and_loses_nothing():
    desk, sent = desk_of(digest=60.0, to=['a', 'b'])
    for n in range(300):
        desk.take(news(valve=f'lv{n}'), 0.1 * n, MONDAY_NOON)
    assert sent == []
    desk.look(60.0)
    assert [m.target for m in sent] == ['a', 'b']
    assert sent[0].title == '[DAMADICS FD] 300 messages of 300 valve(s)'
    assert sent[0].body.endswith('... and 100 more')
    desk.take(news(), 100.0, MONDAY_NOON)
    desk.finish()
    assert len(sent) == 4


def test_mistakes_are_told_together():
    problems = []
    rules = [{'to': ['nobody'], 'classes': ['bad'], 'from': 360, 'day': 'mon'}]
    read_rules(Section({'rules': rules}, '', problems), ('a',))
    text = '\n'.join(problems)
    for words in (
        "'nobody' is not one of a",
        "'bad' is not one of",
        'no time of day',
        'mean days',
    ):
        assert words in text


def test_the_spool_outlives_the_process_and_tells_nothing_twice(tmp_path):
    spool = Spool(tmp_path / 'spool.sqlite')
    assert spool.fresh and spool.first_time('lv1:1:1:raised')
    desk, sent = desk_of()
    desk.take(news(), 0.0, MONDAY_NOON)
    spool.put(sent[0])
    spool.close()
    again = Spool(tmp_path / 'spool.sqlite')
    assert not again.fresh and not again.first_time('lv1:1:1:raised')
    (waiting,) = again.waiting('a')
    assert waiting.message == sent[0]
    again.delivered(waiting.id)
    assert again.count() == 0


def test_a_spool_that_is_none_is_refused(tmp_path):
    (tmp_path / 'spool.sqlite').write_bytes(b'not a database' * 100)
    with pytest.raises(OSError, match='move it away'):
        Spool(tmp_path / 'spool.sqlite')
