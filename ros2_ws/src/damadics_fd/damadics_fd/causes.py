# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The table of texts, advice, NE 107 classes and limits per cause; a user may edit a copy."""

import math
import string
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import yaml

from damadics_fd.core.decision.events import Event
from damadics_fd.core.signature.state import CAUSES
from damadics_fd.store.trends import QUANTITIES

NE107_NAMES = ('normal', 'maintenance', 'out_of_specification', 'function_check', 'failure')
FIELDS = ('tag', 'value', 'margin', 'confidence', 'second')
KEYS = ('text', 'advice', 'ne107')
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
        return 'unknown' if math.isnan(self) else super().__format__(spec)


@dataclass(frozen=True)
class Cause:
    """Hold what the table says about one cause."""

    text: str
    advice: str
    ne107: int  # as in damadics_msgs/FaultFlag

    def describe(
        self,
        tag: str,
        value: float = math.nan,
        std: float = math.nan,
        confidence: float = math.nan,
        second: str = 'none',
    ) -> tuple[str, str]:
        """
        Fill in the texts.

        :param tag: of the actuator.
        :param value: change in the unit of the cause.
        :param std: its standard deviation.
        :param confidence: 0..1.
        :param second: the likeliest cause while it is not certain.
        :return: text, advice.
        """
        words = {
            'tag': tag,
            'value': _Number(value),
            'margin': _Number(2.0 * std),
            'confidence': _Number(min(confidence, MOST_CERTAIN)),
            'second': second.replace('_', ' '),
        }
        return self.text.format(**words), self.advice.format(**words)


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


def load_causes(path: Path | None = None) -> CauseTable:
    """
    Load the table of the package and, over it, the user's.

    :param path: YAML file of the user.
    :return: the table.
    :raises CauseTableError: listing everything that is wrong in the user's file.
    :raises OSError: if the file cannot be read.

    >>> load_causes()['spring_softer'].describe('LV-101', -0.05, 0.0005, 0.99)[0]
    'LV-101: spring softer by -5.0% +- 0.1% (confidence 99%)'
    """
    standard = resources.files('damadics_fd').joinpath('causes.yaml').read_text('utf-8')
    causes, limits = _parse(yaml.safe_load(standard), 'causes.yaml')
    if path is not None:
        try:
            content = yaml.safe_load(Path(path).read_text('utf-8'))
        except yaml.YAMLError as error:
            raise CauseTableError(str(path), [f'not valid YAML: {error}']) from error
        own_causes, own_limits = _parse(content, str(path), causes)
        causes, limits = {**causes, **own_causes}, {**limits, **own_limits}
    return CauseTable(causes, limits)


def _parse(
    content: Any,
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
        elif not isinstance(values, list) or not all(_is_limit(value) for value in values):
            problems.append(f'limits of {name}: expected a list of numbers other than 0')
        else:
            limits[name] = tuple(float(value) for value in values)
    if problems:
        raise CauseTableError(source, problems)
    return causes, limits


def _mapping(content: dict[str, Any], key: str, problems: list[str]) -> dict[str, Any]:
    value = content.get(key) or {}
    if isinstance(value, dict):
        return value
    problems.append(f'{key}: expected names with their entries')
    return {}


def _is_limit(value: Any) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and math.isfinite(value) and value != 0


def _cause(name: str, entry: dict[str, Any], default: Cause | None, problems: list[str]) -> Cause:
    texts = {}
    for key in ('text', 'advice'):
        texts[key] = entry.get(key, getattr(default, key, ''))
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
    return Cause(str(texts['text']), str(texts['advice']), ne107)


def _template_problem(text: Any) -> str:
    if not isinstance(text, str):
        return f'{text!r} is not a text'
    try:
        names = [name for _, name, _, _ in string.Formatter().parse(text) if name is not None]
        unknown = [name for name in names if name not in FIELDS]
        if unknown:
            return f'unknown field {{{unknown[0]}}}; known are {", ".join(FIELDS)}'
        text.format(tag='', value=1.0, margin=1.0, confidence=1.0, second='')
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
    if event.cause in ('', 'none'):
        return event
    cause = table[event.cause]
    text, advice = cause.describe(tag, event.strength, event.spread, event.confidence)
    return replace(event, text=f'{text}; {event.text}', advice=advice)
