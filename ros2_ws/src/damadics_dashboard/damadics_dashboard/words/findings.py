# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What was found at a valve, how much of it and by whom, in the reader's language."""

import math
import re

from damadics_fd.causes import MOST_CERTAIN, Cause
from damadics_fd.core.scada.naming.names import NAMES
from damadics_fd.core.text import SENTENCE, plain

from damadics_dashboard.store.rows import EventRow
from damadics_dashboard.words.answers import answer_words
from damadics_dashboard.words.texts import Texts

SHARED = ('', 'none')
SIGN = re.compile(r'(stem|flow|T1|P1|P2) [-+.\de]+ (%|degC|kPa)( \w+)*')


def cause_of(name: str, t: Texts) -> Cause | None:
    """
    Look up a cause.

    :param name: as an event carries it.
    :param t: the words.
    :return: its entry; None where it has none.
    """
    return t.causes.causes.get(name) if name not in SHARED else None


def faults_of(names: str, t: Texts) -> str:
    """
    Word the faults of the benchmark that a control room's signals show.

    :param names: as an event of mode scada carries them.
    :param t: the words.
    :return: '' where they are no such names.

    >>> from damadics_dashboard.words.texts import texts
    >>> faults_of('f19 or f2', texts('en')), faults_of('friction_up', texts('en'))
    ('f19 flow sensor or f2 plug or seat sedimentation', '')
    """
    known = {f'f{number}': t(f'fault_{number}') for number in NAMES}
    named = names.split(' or ')
    if not set(named) <= set(known):
        return ''
    return t('fault_or').join(f'{name} {known[name]}' for name in named)


def signs_of(text: str, t: Texts) -> str:
    """
    Say what the signals of a control room show, from the text of an event.

    :param text: of the event.
    :param t: the words.
    :return: '' where it does not say that.

    >>> from damadics_dashboard.words.texts import texts
    >>> signs_of('raised 1: ...; f19 flow sensor; flow 25 % too low, P1 +3 kPa', texts('de'))
    'Durchfluss 25 % zu niedrig, P1 +3 kPa'
    """
    signs = text.rpartition('; ')[2].split(', ')
    if not all(SIGN.fullmatch(sign) for sign in signs):
        return ''
    return ', '.join(answer_words(sign, t.language) for sign in signs)


def numbers_of(event: EventRow, t: Texts) -> str:
    """
    Return the numbers that a detector tells behind the words that the page has anyway.

    :param event: the evidence of an alarm; may be empty.
    :param t: the words.
    :return: a line, '' where there is none.
    """
    told = plain(event.get('text') or '', SENTENCE)
    if told.endswith(']'):
        told = told[:-1].rpartition(' [')[2]
    cause = event.get('cause') or ''
    if named := faults_of(cause, t):
        told = told.replace(
            ' or '.join(f'{n} {NAMES[int(n[1:])]}' for n in cause.split(' or ')), named
        )
    return answer_words(told, t.language)


def headline(event: EventRow, t: Texts) -> tuple[str, str, str]:
    """
    Say first what is wrong and how much, and what to do.

    :param event: the evidence of an alarm, as the history keeps it; may be empty.
    :param t: the words.
    :return: what is wrong, the numbers of the cause, what to do.
    """
    cause = cause_of(event.get('cause') or '', t)
    if cause is not None:
        strength = event.get('strength')
        confidence = event.get('confidence')
        return cause.words(
            math.nan if strength is None else strength,
            event.get('deviation', math.nan),
            math.nan if confidence is None else confidence,
        )
    if named := faults_of(event.get('cause') or '', t):
        sure = event.get('confidence')
        numbers = '' if sure is None else t('sure', share=t.percent(min(sure, MOST_CERTAIN)))
        return t('looks_like', cause=named), numbers, t('deviates_advice')
    ratio = event.get('ratio')
    if ratio is not None and math.isfinite(ratio) and ratio >= 1.0:
        return t('deviates', size=of_limit(ratio, t)), '', t('deviates_advice')
    return t('deviates_some'), '', t('deviates_advice')


def found_by(event: EventRow, t: Texts) -> str:
    """
    Say who found a fault.

    :param event: the evidence of an alarm; may be empty.
    :param t: the words.
    :return: a sentence, '' where nothing is known.
    """
    if event.get('found_by') == 'control-room test' or faults_of(event.get('cause') or '', t):
        return t('found_test')
    ratio = event.get('ratio')
    if ratio is None or not math.isfinite(ratio):
        return ''
    if ratio < 1.0:
        return t('found_signature')
    return t('found_both' if cause_of(event.get('cause') or '', t) else 'found_threshold')


def of_limit(ratio: float | None, t: Texts) -> str:
    """
    Word how large a residual is.

    :param ratio: residual / threshold.
    :param t: the words.
    :return: in percent of the limit, or as its multiple.
    """
    if ratio is None or not math.isfinite(ratio):
        return '–'
    if ratio < 10.0:
        return t('of_limit', share=f'{100.0 * ratio:.0f}')
    return t('times_limit', ratio=t.number(ratio))
