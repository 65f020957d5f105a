# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A setting: a dataclass field with unit, range, description, default and readers of each mode."""

from collections.abc import Iterator
from dataclasses import Field, dataclass, field, fields
from typing import ClassVar, TypeAlias

import numpy as np

from damadics_fd.core.modes import MODES
from damadics_fd.core.record import Array, Plain

KINDS: dict[type, str] = {bool: '?', int: 'i8', float: 'f8', tuple: 'f8'}
Value = str | bool | int | float | tuple[float, ...]
Given: TypeAlias = Plain | tuple[float, ...]  # for a setting, not checked yet
APPROXIMATOR = ('paper', 'monitor')  # the modes with the on-line approximator


def number(
    unit: str,
    text: str,
    low: float,
    high: float,
    default: float,
    *,
    paper: float | None = None,
    scada: float | None = None,
    modes: tuple[str, ...] = MODES,
) -> float:
    """
    Declare a number.

    :param unit: of it, '' for none.
    :param text: what it is.
    :param low: least value allowed.
    :param high: greatest value allowed.
    :param default: in mode monitor, and in every other mode for which none is given.
    :param paper: default in mode paper.
    :param scada: default in mode scada.
    :param modes: the modes that read it.
    :return: the field.
    """
    meta = _meta(text, _defaults(default, paper, scada), modes, unit, low=low, high=high)
    return field(default=default, metadata=meta)


def whole(
    unit: str,
    text: str,
    low: int,
    high: int,
    default: int,
    *,
    scada: int | None = None,
    modes: tuple[str, ...] = MODES,
) -> int:
    """
    Declare a whole number.

    :param unit: as for `number`, like all that follow.
    :return: the field.
    """
    meta = _meta(text, _defaults(default, None, scada), modes, unit, low=low, high=high)
    return field(default=default, metadata=meta)


def choice(
    text: str,
    options: tuple[str, ...],
    default: str,
    *,
    paper: str | None = None,
    modes: tuple[str, ...] = MODES,
) -> str:
    """
    Declare a choice.

    :param text: what it is.
    :param options: the values allowed.
    :param default: in all modes but paper where that differs.
    :param paper: default in mode paper.
    :param modes: the modes that read it.
    :return: the field.
    """
    meta = _meta(text, _defaults(default, paper), modes, choices=options)
    return field(default=default, metadata=meta)


def switch(
    text: str, default: bool, *, paper: bool | None = None, modes: tuple[str, ...] = MODES
) -> bool:
    """
    Declare a switch.

    :param text: what it is.
    :param default: in all modes but paper where that differs.
    :param paper: default in mode paper.
    :param modes: the modes that read it.
    :return: the field.
    """
    meta = _meta(text, _defaults(default, paper), modes)
    return field(default=default, metadata=meta)


def table(
    unit: str, text: str, low: float, high: float, default: tuple[float, ...]
) -> tuple[float, ...]:
    """
    Declare a list of numbers of fixed length.

    :param unit: of them, '' for none.
    :param text: what they are.
    :param low: least value allowed.
    :param high: greatest value allowed.
    :param default: in all modes.
    :return: the field.
    """
    meta = _meta(text, _defaults(default), MODES, unit, low=low, high=high)
    return field(default=default, metadata=meta)


Meta = dict[str, str | float | tuple[str, ...] | dict[str, Value]]


def _defaults(
    default: Value, paper: Value | None = None, scada: Value | None = None
) -> dict[str, Value]:
    return {
        'monitor': default,
        'paper': default if paper is None else paper,
        'scada': default if scada is None else scada,
    }


def _meta(
    text: str,
    defaults: dict[str, Value],
    modes: tuple[str, ...],
    unit: str = '',
    **limits: float | tuple[str, ...],
) -> Meta:
    return {'unit': unit, 'description': text, **limits, 'default': defaults, 'modes': modes}


class SettingsError(ValueError):
    """
    Tell every error of a set of settings at once.

    :param problems: one sentence per error, naming the setting and the remedy.
    """

    def __init__(self, problems: list[str]) -> None:
        self.problems = problems
        super().__init__('; '.join(problems))


@dataclass(frozen=True, eq=False, repr=False)
class Section:
    """
    Hold settings that belong together; a compiled step reads them from `record()`.

    A compiled step that takes a record of settings states the section, `def step(c: Valve)`.
    Text is nothing for compiled code: it reads what `DERIVED` names, properties of the section.
    """

    DERIVED: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        """Refuse wrong values; take a whole number where any number is fine."""
        problems = self.problems()
        if problems:
            raise SettingsError(problems)
        for item in fields(self):
            value = getattr(self, item.name)
            if item.type is float:
                object.__setattr__(self, item.name, float(value))
            elif isinstance(item.default, tuple):
                object.__setattr__(self, item.name, tuple(float(v) for v in value))

    def problems(self) -> list[str]:
        """
        List every error of the values.

        :return: one sentence per error; empty where all is well.
        """
        texts = (problem_of(item, getattr(self, item.name)) for item in fields(self))
        return list(filter(None, texts))

    def record(self) -> Array:
        """
        Return the numbers for the compiled steps.

        :return: structured array of length 1: the numbers, switches, tables and derived numbers.
        """
        kind = type(self)
        dtype = _layouts.get(kind)
        if dtype is None:
            values = [(name, getattr(self, name)) for name in _numbers(kind)]
            columns = [(name, KINDS[type(value)], np.shape(value)) for name, value in values]
            dtype = _layouts[kind] = np.dtype((np.record, np.dtype(columns, align=True)))
        array = np.zeros(1, dtype)
        array[0] = tuple([getattr(self, name) for name in dtype.names or ()])
        return array


_layouts: dict[type[Section], np.dtype[np.void]] = {}


def _numbers(kind: type[Section]) -> Iterator[str]:
    """Return the names of what compiled code can read."""
    for item in fields(kind):
        if item.type is not str:
            yield item.name
    for base in reversed(kind.__mro__):
        yield from vars(base).get('DERIVED', ())


def wrong_choice(name: str, value: Given, options: tuple[str, ...]) -> str:
    """
    Say that a value is none of the options.

    :param name: of the setting.
    :param value: its value.
    :param options: the values allowed.
    :return: one sentence.
    """
    return f'{name} = {value!r} is not one of {", ".join(options)}'


def problem_of(item: 'Field[Value]', value: Value) -> str:
    """
    Say what is wrong with a value.

    :param item: the field of the setting.
    :param value: its value.
    :return: one sentence; '' where all is well.
    """
    name, meta = item.name, item.metadata
    if 'choices' in meta:
        return '' if value in meta['choices'] else wrong_choice(name, value, meta['choices'])
    if item.type is bool:
        return '' if isinstance(value, bool) else f'{name} = {value!r} is not true or false'
    if isinstance(item.default, tuple):
        return _table_problem(item, value)
    kinds = int if item.type is int else (int, float)
    if isinstance(value, bool) or not isinstance(value, kinds):
        kind = 'a whole number' if item.type is int else 'a number'
        return f'{name} = {value!r} is not {kind}'
    if not meta['low'] <= value <= meta['high']:  # also catches NaN
        unit = f' {meta["unit"]}' if meta['unit'] else ''
        return f'{name} = {value!r}{unit} is outside {meta["low"]:g}..{meta["high"]:g}'
    return ''


def _table_problem(item: 'Field[Value]', value: Value) -> str:
    length = len(item.metadata['default']['monitor'])
    low, high = item.metadata['low'], item.metadata['high']
    if isinstance(value, str | int | float):
        return f'{item.name} = {value!r} is not a list of numbers'
    try:
        numbers = [float(v) for v in value]
    except (TypeError, ValueError, OverflowError):
        return f'{item.name} = {value!r} is not a list of numbers'
    if len(numbers) != length or not all(low <= v <= high for v in numbers):
        return f'{item.name} needs {length} numbers in {low:g}..{high:g}'
    return ''
