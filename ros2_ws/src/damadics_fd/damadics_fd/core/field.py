# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A setting: a dataclass field with unit, range, description and the default of each mode."""

from dataclasses import Field, field
from typing import Any


def number(unit: str, text: str, low: float, high: float, paper: Any, monitor: Any) -> Any:
    """
    Declare a number.

    :param unit: of it, '' for none.
    :param text: what it is.
    :param low: least value allowed.
    :param high: greatest value allowed.
    :param paper: default in mode paper.
    :param monitor: default in mode monitor.
    :return: the field.
    """
    meta = {
        'unit': unit,
        'description': text,
        'low': low,
        'high': high,
        'default': {'paper': paper, 'monitor': monitor},
    }
    return field(default=monitor, metadata=meta)


def choice(text: str, options: tuple[str, ...], paper: str, monitor: str) -> Any:
    """
    Declare a choice.

    :param text: what it is.
    :param options: the values allowed.
    :param paper: default in mode paper.
    :param monitor: default in mode monitor.
    :return: the field.
    """
    meta = {
        'unit': '',
        'description': text,
        'choices': options,
        'default': {'paper': paper, 'monitor': monitor},
    }
    return field(default=monitor, metadata=meta)


def switch(text: str, paper: bool, monitor: bool) -> Any:
    """
    Declare a switch.

    :param text: what it is.
    :param paper: default in mode paper.
    :param monitor: default in mode monitor.
    :return: the field.
    """
    meta = {'unit': '', 'description': text, 'default': {'paper': paper, 'monitor': monitor}}
    return field(default=monitor, metadata=meta)


def wrong_choice(name: str, value: Any, options: tuple[str, ...]) -> str:
    """
    Say that a value is none of the options.

    :param name: of the setting.
    :param value: its value.
    :param options: the values allowed.
    :return: one sentence.
    """
    return f'{name} = {value!r} is not one of {", ".join(options)}'


def problem_of(item: Field, value: Any) -> str:
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


def _table_problem(item: Field, value: Any) -> str:
    default: Any = item.default
    length, low, high = len(default), item.metadata['low'], item.metadata['high']
    try:
        table = [float(v) for v in value]
    except (TypeError, ValueError):
        return f'{item.name} = {value!r} is not a list of numbers'
    if len(table) != length or not all(low <= v <= high for v in table):
        return f'{item.name} needs {length} numbers in {low:g}..{high:g}'
    return ''
