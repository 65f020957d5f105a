# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is said of a valve, its alarm and its history, as plain text in the reader's language."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote

from damadics_fd.core.decision.events import STATISTIC
from damadics_fd.core.stamps import SECOND as NANO
from damadics_fd.core.text import SENTENCE, plain
from damadics_msgs.msg import FaultEvent

from damadics_dashboard.live.judged import NE107
from damadics_dashboard.live.valve import Alarm, Condition, Valve
from damadics_dashboard.store.rows import Cell, EventRow
from damadics_dashboard.words.answers import answer_words
from damadics_dashboard.words.findings import (
    faults_of,
    found_by,
    headline,
    numbers_of,
    of_limit,
    signs_of,
)
from damadics_dashboard.words.texts import DASH, Texts

RECENT = 3.0  # s; diagnostics come every second
UNMONITORED = re.compile('not monitored[,:] ')  # the title says it
LEARNING = ' %: '  # before what an estimator says of why it learns for long
TRANSITIONS = {
    FaultEvent.RAISED: 'raised',
    FaultEvent.CLEARED: 'cleared',
    FaultEvent.ACKNOWLEDGED: 'acknowledged',
    FaultEvent.RESET: 'reset_done',
    FaultEvent.SHELVED: 'shelved_done',
    FaultEvent.UNSHELVED: 'unshelved',
    FaultEvent.NEAR_MISS: 'near_miss',
    FaultEvent.CHANGED: 'changed',
}


@dataclass(frozen=True)
class AlarmWords:
    """An alarm for a person: what is wrong and how much, what to do, and what stands behind."""

    headline: str
    advice: str
    level: str
    state: str
    seen: str
    since: str
    found: str
    text: str
    cells: list[tuple[str, str]]


def address(name: str) -> str:
    """
    Return the address of a valve's page.

    :param name: name of the valve.
    :return: path.

    >>> address('area1/lv101'), address('a?b')
    ('/valve/area1/lv101', '/valve/a%3Fb')
    """
    return '/valve/' + quote(name or '~root')


def area_of(name: str) -> str:
    """
    Return the part of the plant that a valve belongs to.

    :param name: of the valve, with the namespace before it.
    :return: that namespace, '' for none.

    >>> area_of('unit2/lv101'), area_of('lv101')
    ('unit2', '')
    """
    return name.rpartition('/')[0]


def detail_of(condition: Condition, t: Texts) -> str:
    """
    Word the detail of a condition.

    :param condition: of a valve.
    :param t: the words.
    :return: text.
    """
    if math.isnan(condition.value):
        return t(condition.detail)
    if condition.detail == 'learned_share':
        return t('learned_share', share=t.percent(condition.value))
    return t(condition.detail, time=t.duration(condition.value))


def reason_of(valve: Valve, condition: Condition, t: Texts, now: float) -> str:
    """
    Word the detail of a condition, with what the estimator says of its input.

    :param valve: the valve.
    :param condition: of the valve.
    :param t: the words.
    :param now: monotonic time [s].
    :return: text.
    """
    told = valve.diagnostics.get('estimator', {})
    if now - valve.told_at.get('estimator', -math.inf) < RECENT and not condition.alarm:
        number = told.get('Publishers', '')
        if number.isdigit() and int(number) > 1 and condition.kind in ('off', 'learn'):
            return t('several_publishers', number=number)
        said = plain(told.get('Message', ''), SENTENCE)
        if said and valve.levels.get('estimator', 0):
            if condition.detail == 'input_refused':
                return answer_words(UNMONITORED.sub('', said), t.language)
            if condition.kind == 'learn' and (why := said.partition(LEARNING)[2]):
                return f'{detail_of(condition, t)}: {answer_words(why, t.language)}'
    return detail_of(condition, t)


def alarm_words(valve: Valve, alarm: Alarm, t: Texts, *, name: bool) -> AlarmWords:
    """
    Word an alarm.

    :param valve: the valve.
    :param alarm: its alarm.
    :param t: the words.
    :param name: whether to name the valve.
    :return: texts.
    """
    e = alarm.evidence
    who = f'{valve.title}: ' if name else ''
    if alarm.state == 'unknown':
        what, numbers, advice = t('state_lost'), '', t('state_lost_advice')
    else:
        what, numbers, advice = headline(e, t)
    ratio, limit = e.get('ratio'), e.get('threshold')
    unit = '' if limit == STATISTIC else '1/s'
    cells = [
        (t('alarm_number'), str(alarm.occurrence or DASH)),
        (t('numbers'), numbers or DASH),
        (t('largest_residual'), of_limit(ratio, t)),
        (t('residual_now'), t.number(e.get('residual'), unit)),
        (t('limit'), t.number(limit, unit)),
        (t('duration'), _lasting(e, t)),
        (t('since'), t.moment(alarm.onset)),
    ]
    letter = NE107.get(alarm.level, 'C') or 'M'
    return AlarmWords(
        who + what,
        advice,
        t(f'ne_{letter}'),
        t(f'alarm_{alarm.state}'),
        t('acknowledged' if alarm.acknowledged else 'unacknowledged'),
        t('since_time', time=t.moment(alarm.onset)) if alarm.onset else '',
        found_by(e, t),
        numbers_of(e, t),
        [cell for cell in cells if cell[1] != DASH],
    )


def alarm_kind(alarm: Alarm) -> str:
    """
    Return the NE 107 letter of an alarm.

    :param alarm: the alarm.
    :return: F, C, S or M.
    """
    return NE107.get(alarm.level, 'C') or 'M'


def history_rows(rows: Sequence[EventRow], t: Texts) -> list[dict[str, Cell]]:
    """
    Word transitions and actions for a table.

    :param rows: as the history returns them.
    :param t: the words.
    :return: what the template shows of each.
    """
    return [_row(row, t) for row in rows]


def _row(row: EventRow, t: Texts) -> dict[str, Cell]:
    transition = row['transition']
    what, numbers, advice = '', '', ''
    if transition in (FaultEvent.RAISED, FaultEvent.CHANGED):
        what, numbers, advice = headline(row, t)
    elif transition == FaultEvent.CLEARED and row['duration'] is not None:
        what = t('lasted', time=_lasting(row, t))
    elif transition == FaultEvent.NEAR_MISS and row['ratio'] is not None:
        what = t('near_miss_text', size=of_limit(row['ratio'], t))
    told = plain(row['text'] or '', SENTENCE)
    if faults_of(row['cause'] or '', t) and (signs := signs_of(told, t)):
        advice = f'{signs}. {advice}'
    return {
        'moment': t.moment(row['stamp']),
        'valve': row['valve'] or 'valve',
        'address': address(row['valve']),
        'kind': NE107.get(row['level'], '') or 'ok',
        'what': t(TRANSITIONS[transition]) if transition in TRANSITIONS else '?',
        'occurrence': row['occurrence'] or '',
        'ratio': of_limit(row['ratio'], t),
        'text': f'{what} {numbers}'.strip() or told,
        'more': advice,
    }


def _lasting(event: EventRow, t: Texts) -> str:
    """Word how long a fault was there, and how much of it nobody could look."""
    time, unseen = t.duration(event.get('duration')), event.get('unseen')
    return t('part_unseen', time=time, unseen=t.duration(unseen)) if unseen else time


def seconds_of(stamp: int) -> float:
    """
    Return a stamp in seconds, as plots take it.

    :param stamp: [ns].
    :return: [s].
    """
    return stamp / NANO
