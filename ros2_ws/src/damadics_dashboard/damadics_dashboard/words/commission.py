# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the commissioning of a valve has shown, in the reader's language."""

from collections.abc import Mapping
from typing import NamedTuple

from damadics_fd.core.settings.identified import VERDICTS
from damadics_fd.core.text import SENTENCE, plain

from damadics_dashboard.words.answers import answer_words
from damadics_dashboard.words.texts import Texts

FRICTION = 'Friction change found within an hour (%)'
STIFFNESS = 'Stiffness change found within an hour (%)'


class CommissionWords(NamedTuple):
    """A verdict for a person; all empty where nothing is known yet."""

    verdict: str = ''  # no, ok, limited or refused: also a class of the style sheet
    title: str = ''
    finds: str = ''
    because: str = ''  # as the command worded it


def commission_words(told: Mapping[str, str], t: Texts) -> CommissionWords:
    """
    Word the verdict of `commission`.

    :param told: values of the detector's diagnostics.
    :param t: the words.
    :return: texts; empty ones where the detector has told nothing.
    """
    verdict = told.get('Commissioned', '')
    if not verdict:
        return CommissionWords()
    if verdict not in VERDICTS:
        return CommissionWords('no', t('commission_no'), t('commission_no_text'))
    finds = ''
    if FRICTION in told and STIFFNESS in told:
        friction, stiffness = (t.local(plain(told[name])) for name in (FRICTION, STIFFNESS))
        finds = t('commission_finds', friction=friction, stiffness=stiffness)
    because = answer_words(plain(told.get('Commissioned because', ''), SENTENCE), t.language)
    return CommissionWords(verdict, t(f'commission_{verdict}'), finds, because)
