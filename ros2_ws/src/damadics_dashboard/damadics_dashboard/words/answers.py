# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What nodes answer to people, in the reader's language."""

import re
from collections.abc import Mapping
from functools import cache
from importlib import resources

import yaml

from damadics_dashboard.store.rows import ActionRow
from damadics_dashboard.words.texts import Texts

GAP = '{}'  # in a sentence: what changes


def answer_words(text: str, language: str) -> str:
    """
    Translate what a node answered.

    :param text: as the node says it, in English.
    :param language: code of the reader's.
    :return: the same in that language; the text itself where there is no translation.

    >>> answer_words('alarm 3 acknowledged', 'de'), answer_words('alarm 3 acknowledged', 'en')
    ('Alarm 3 quittiert.', 'alarm 3 acknowledged')
    >>> answer_words('p1 is the constant 3 Pa: it is not measured; an alarm stands', 'de')
    'p1 ist die Konstante 3 Pa: es wird nicht gemessen; ein Alarm steht an'
    >>> answer_words('partial strokes ended: an alarm stands', 'de')
    'Teilhübe beendet: ein Alarm steht an'
    """
    for said, words in _known(language):
        if found := said.fullmatch(text):
            return words.format(*(answer_words(part, language) for part in found.groups()))
    return text


def result_words(row: ActionRow, t: Texts) -> str:
    """
    Say what became of what somebody did.

    :param row: as the history returns it.
    :param t: the words.
    :return: text; '' where it was done and there is no more to say.
    """
    said = answer_words(row['result'] or '', t.language)
    return said if row['done'] else f'{t("refused")}: {said}'


@cache
def _known(language: str) -> list[tuple[re.Pattern[str], str]]:
    content = resources.files('damadics_dashboard.words').joinpath('answers.yaml')
    loaded: Mapping[str, Mapping[str, str]] = yaml.safe_load(content.read_text('utf-8'))
    return [
        (re.compile('(.+?)'.join(map(re.escape, said.split(GAP)))), words)
        for said, words in loaded.get(language, {}).items()
    ]
