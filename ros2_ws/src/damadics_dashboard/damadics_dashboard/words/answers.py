# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What nodes answer to people, in the reader's language."""

import re
from collections.abc import Mapping
from functools import cache, lru_cache
from importlib import resources

import yaml

from damadics_dashboard.store.rows import ActionRow
from damadics_dashboard.words.texts import Texts

GAP = '{}'  # in a sentence: what changes
AND = '; '  # between sentences, and within some
MOST = 4  # such parts of one sentence
NUMBER = re.compile(r'[-+]?\d+\.\d+(e[-+]?\d+)?')


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
    >>> answer_words('no limit can be proposed: x; record longer; an alarm stands', 'de')
    'Es lässt sich keine Grenze vorschlagen: x; länger aufzeichnen; ein Alarm steht an'
    """
    return _told(text, language)[0] if _known(language) else text


@lru_cache(maxsize=512)
def _told(text: str, language: str) -> tuple[str, int]:
    """Translate sentences; return them and how many characters were left as they are."""
    clauses = text.split(AND)
    after = [('', 0)]  # of the last clauses, from none of them to all
    for begin in reversed(range(len(clauses))):
        found = []
        for end in range(begin + 1, min(begin + MOST, len(clauses)) + 1):
            words, left = _sentence(AND.join(clauses[begin:end]), language)
            rest, rest_left = after[end - begin - 1]
            found.append((AND.join(part for part in (words, rest) if part), left + rest_left))
        after.insert(0, min(found, key=lambda candidate: candidate[1]))
    return after[0]


def _sentence(text: str, language: str) -> tuple[str, int]:
    """Translate one sentence with what changes in it, so that least is left."""
    found = [(text.replace('.', ','), 1) if NUMBER.fullmatch(text) else (text, len(text))]
    for said, words in _known(language):
        if matched := said.fullmatch(text):
            gaps = [_told(part, language) for part in matched.groups()]
            found.append((words.format(*(gap for gap, _ in gaps)), sum(n for _, n in gaps)))
    return min(found, key=lambda candidate: candidate[1])


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
