# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The table of texts, advice, NE 107 classes and limits per cause; a user may edit a copy."""

import math
import string
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TypeGuard

import yaml

from damadics_fd.core.decision.events import Event
from damadics_fd.core.record import Plain, Saved
from damadics_fd.core.signature.state import CAUSES
from damadics_fd.store.trends import QUANTITIES
from damadics_fd.store.yaml_text import read_yaml

NE107_NAMES = ('normal', 'maintenance', 'out_of_specification', 'function_check', 'failure')
FIELDS = ('tag', 'value', 'less', 'factor', 'bar', 'margin', 'confidence', 'second')
TEXTS = ('text', 'unsized', 'detail', 'advice')
KEYS = (*TEXTS, 'ne107')
LANGUAGES = ('en', 'de')
MOST_CERTAIN = 0.99  # no text promises 100 %


class CauseTableError(ValueError):
    """
    Tell every error of a cause table at once.

    :param source: name of the file.
    :param problems: one sentence per error.
    """

    def __init__(self, source: str, problems: list[str]) -> None:
        self.problems = problems
        super().__init__(f'{source}: ' + '; '.join(problems))


class _Number(float):
    """A number that reads "unknown" where it is NaN, whatever its format."""

    def __format__(self, spec: str) -> str:
        if math.isnan(self):
            return 'unknown'
        return super().__format__(spec).replace('%', ' %')


class _Zahl(float):
    """The same in German."""

    def __format__(self, spec: str) -> str:
        if math.isnan(self):
            return 'unbekannt'
        return super().__format__(spec).replace('.', ',').replace('%', ' %')


@dataclass(frozen=True)
class Cause:
    """Hold what the table says about one cause: what is wrong, the numbers, what to do."""

    text: str
    advice: str
    ne107: int  # as in damadics_msgs/FaultFlag
    detail: str = ''
    language: str = 'en'
    unsized: str = ''  # in place of `text` while nobody knows how much

    def words(
        self,
        value: float = math.nan,
        std: float = math.nan,
        confidence: float = math.nan,
        second: str = 'none',
        tag: str = '',
    ) -> tuple[str, str, str]:
        """
        Fill in the texts.

        :param value: change in the unit of the cause.
        :param std: its standard deviation.
        :param confidence: 0..1.
        :param second: the likeliest cause while it is not certain.
        :param tag: of the actuator.
        :return: what is wrong and how much; the numbers, '' where none is known; what to do.
        """
        number = _Zahl if self.language == 'de' else _Number
        words = {
            'tag': tag,
            'value': number(value),
            'less': number(-value),
            'factor': number(1.0 + value),
            'bar': number(value * 1e-5),
            'margin': number(2.0 * std),
            'confidence': number(min(confidence, MOST_CERTAIN)),
            'second': second.replace('_', ' '),
        }
        detail = self.detail.split(' ±')[0] if math.isnan(std) else self.detail
        known = [] if math.isnan(value) or not detail else [detail.format(**words)]
        if not math.isnan(confidence):
            sure = 'Wahrscheinlichkeit' if self.language == 'de' else 'confidence'
            known.append(f'{sure} {words["confidence"]:.0%}')
        text = self.unsized if math.isnan(value) and self.unsized else self.text
        return text.format(**words), ', '.join(known), self.advice.format(**words)

    def describe(
        self,
        tag: str,
        value: float = math.nan,
        std: float = math.nan,
        confidence: float = math.nan,
        second: str = 'none',
    ) -> tuple[str, str]:
        """
        Fill in the texts for a list or a log, where the actuator has to be named.

        :param tag: of the actuator.
        :param value: change in the unit of the cause.
        :param std: its standard deviation.
        :param confidence: 0..1.
        :param second: the likeliest cause while it is not certain.
        :return: text with its numbers, advice.
        """
        text, numbers, advice = self.words(value, std, confidence, second, tag)
        named = text if '{tag}' in self.text else f'{tag}: {text}'
        return (f'{named} ({numbers})' if numbers else named), advice


@dataclass(frozen=True)
class CauseTable:
    """Hold the entries for all causes and the limits of the trends."""

    causes: Mapping[str, Cause]
    limits: Mapping[str, tuple[float, ...]]

    @property
    def classes(self) -> tuple[int, ...]:
        """NAMUR NE 107 class of each of CAUSES, as `Detector` takes them."""
        return tuple(self.causes[name].ne107 for name in CAUSES)

    def __getitem__(self, cause: str) -> Cause:
        """Return the entry of a cause by its name."""
        return self.causes[cause]


@cache
def _own(name: str) -> Plain:
    """Return the content of a table of the package; read once, since YAML is slow."""
    text = resources.files('damadics_fd').joinpath(name).read_text('utf-8')
    return read_yaml(text)


def load_causes(path: Path | None = None, language: str = 'en') -> CauseTable:
    """
    Load the table of the package and, over it, the user's.

    :param path: YAML file of the user.
    :param language: one of LANGUAGES, for what the user's file leaves out.
    :return: the table.
    :raises CauseTableError: listing everything that is wrong in the user's file.
    :raises OSError: if the file cannot be read.

    >>> load_causes()['spring_softer'].describe('LV-101', -0.05, 0.0005, 0.99)[0]
    'LV-101: The spring is 5.0 % softer than learned. (-5.0 % ± 0.1 %, confidence 99 %)'
    >>> load_causes()['friction_up'].words()[0]
    'Friction is higher than normal; how much is not known yet.'
    """
    causes, limits = _parse(_own('causes.yaml'), 'causes.yaml')
    if language != 'en':
        name = f'causes.{language}.yaml'
        translated, _ = _parse(_own(name), name, causes)
        causes |= {key: replace(cause, language=language) for key, cause in translated.items()}
    if path is not None:
        try:
            content = read_yaml(Path(path).read_text('utf-8'))
        except yaml.YAMLError as error:
            raise CauseTableError(str(path), [f'not valid YAML: {error}']) from error
        own_causes, own_limits = _parse(content, str(path), causes)
        causes, limits = {**causes, **own_causes}, {**limits, **own_limits}
    return CauseTable(causes, limits)


def _parse(
    content: Plain,
    source: str,
    standard: Mapping[str, Cause] | None = None,
) -> tuple[dict[str, Cause], dict[str, tuple[float, ...]]]:
    if not isinstance(content, dict) or not set(content) <= {'causes', 'limits'}:
        raise CauseTableError(source, ['expected the keys "causes" and "limits"'])
    problems: list[str] = []
    causes = {}
    for name, entry in _mapping(content, 'causes', problems).items():
        if name not in CAUSES:
            problems.append(f'no such cause: {name}; known are {", ".join(CAUSES)}')
        elif not isinstance(entry, dict) or not set(entry) <= set(KEYS):
            problems.append(f'{name}: expected some of the keys {", ".join(KEYS)}')
        else:
            default = standard[name] if standard else None
            causes[name] = _cause(name, entry, default, problems)
    limits = {}
    for name, values in _mapping(content, 'limits', problems).items():
        if name not in QUANTITIES:
            problems.append(f'no such quantity: {name}; known are {", ".join(QUANTITIES)}')
        elif not isinstance(values, list):
            problems.append(f'limits of {name}: expected a list of numbers other than 0')
        else:
            limits[name] = tuple(float(value) for value in values if _is_limit(value))
            if len(limits[name]) < len(values):
                problems.append(f'limits of {name}: expected a list of numbers other than 0')
    if problems:
        raise CauseTableError(source, problems)
    return causes, limits


def _mapping(content: Saved, key: str, problems: list[str]) -> Saved:
    value = content.get(key) or {}
    if isinstance(value, dict):
        return value
    problems.append(f'{key}: expected names with their entries')
    return {}


def _is_limit(value: Plain) -> TypeGuard[float]:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) and value != 0


def _cause(name: str, entry: Saved, default: Cause | None, problems: list[str]) -> Cause:
    texts = {}
    for key in TEXTS:
        given = '' if key == 'unsized' and 'text' in entry else getattr(default, key, '')
        texts[key] = entry.get(key, given)  # who words a cause anew words it whole
        problem = _template_problem(texts[key])
        if problem:
            problems.append(f'{name}, {key}: {problem}')
    level = entry.get('ne107')
    if level is None and default is not None:
        ne107 = default.ne107
    elif level in NE107_NAMES:
        ne107 = NE107_NAMES.index(level)
    else:
        problems.append(f'{name}: ne107 {level!r} is not one of {", ".join(NE107_NAMES)}')
        ne107 = 0
    language = default.language if default is not None else 'en'
    text, unsized, detail, advice = (str(texts[key]) for key in TEXTS)
    return Cause(text, advice, ne107, detail, language, unsized)


def _template_problem(text: Plain) -> str:
    if not isinstance(text, str):
        return f'{text!r} is not a text'
    try:
        names = [name for _, name, _, _ in string.Formatter().parse(text) if name is not None]
        unknown = [name for name in names if name not in FIELDS]
        if unknown:
            return f'unknown field {{{unknown[0]}}}; known are {", ".join(FIELDS)}'
        text.format(**dict.fromkeys(FIELDS, 1.0) | {'tag': '', 'second': ''})
    except (ValueError, IndexError, KeyError) as error:
        return str(error)
    return ''


def explain(event: Event, table: CauseTable, tag: str) -> Event:
    """
    Word an event by the table once the signature has a cause for it.

    :param event: a transition of the alarm.
    :param table: texts.
    :param tag: of the actuator.
    :return: the event with text and advice of its cause; its class already counts the cause.
    """
    if event.cause == 'none' or event.cause not in table.causes:
        return event
    cause = table[event.cause]
    text, advice = cause.describe(tag, event.strength, event.spread, event.confidence)
    return replace(event, text=f'{text} {found_by(event.ratio)} [{event.text}]', advice=advice)


def found_by(ratio: float) -> str:
    """
    Say who found a change that the signature has a cause for.

    :param ratio: largest residual / threshold of the fault; NaN where the threshold was 0.
    :return: one sentence.
    """
    if ratio < 1.0:
        return 'Found by the valve signature.'
    return 'Found by the threshold, named by the valve signature.'
