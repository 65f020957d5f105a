# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Signals of a valve from several topics of a bag, on one clock."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from damadics_fd.bag.arrays import Column, Columns, Places
from damadics_fd.bag.columns import read_columns
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mapping import TIMES, Source

_ELEMENT = re.compile(r'\[(\d+)\]$')  # of an array
Told = Callable[[str], None]


def mapped(path: Path, maps: Mapping[str, Source], on_problem: Told) -> Columns:
    """
    Read signals from several topics; each holds its value until its next message.

    :param path: of the bag.
    :param maps: the source of each signal.
    :param on_problem: told each damaged place, which is left out.
    :return: `stamp` [ns] and the signals.
    :raises BagError: where one cannot be read or has no place on the common clock.
    """
    parsed: dict[str, tuple[str, str, int | None]] = {}
    for signal, source in maps.items():
        if signal in TIMES:
            raise BagError(
                f'--map {signal}={source.name}: in a bag the time is that of the messages', path
            )
        topic, dot, name = source.name.partition('.')
        if not dot:
            raise BagError(f'--map {signal}={source.name}: write /topic.field', path)
        index = _ELEMENT.search(name)
        parsed[signal] = (
            topic,
            _ELEMENT.sub('', name),
            int(index[1]) if index else None,
        )
        for other in [*parsed][:-1]:
            if _place(parsed[other]) == _place(parsed[signal]):
                raise BagError(
                    f'--map: {other} and {signal} are both {source.name}: each has a field of'
                    ' its own',
                    path,
                )
    if not {'cv', 'x1'} <= parsed.keys():
        raise BagError('--map must name at least cv and x1', path)
    read = {
        topic: read_columns(
            path,
            topic,
            sorted({name for other, name, _ in parsed.values() if other == topic}),
            on_problem=on_problem,
        )
        for topic in {topic for topic, _, _ in parsed.values()}
    }
    clock = _clock(read, path)
    base = read[parsed['x1'][0]][clock]
    columns: Columns = {'stamp': base}
    for signal, (topic, name, element) in parsed.items():
        values = np.asarray(read[topic][name], float)
        if values.ndim > 1 and element is not None and element < values.shape[1]:
            values = values[:, element]
        if values.ndim != 1:
            raise BagError(
                f'--map {signal}={topic}.{name}: the field is an array of'
                f' {values.shape[1]}; write {topic}.{name}[0]',
                path,
            )
        scaled = maps[signal].scale(values)
        columns[signal] = hold(read[topic][clock], scaled, base)
    known = np.isfinite(columns['cv'])
    if len(base) and not known.any():
        raise BagError(
            f'--map: no message of {parsed["cv"][0]} comes before the last one of'
            f' {parsed["x1"][0]}',
            path,
        )
    return {name: column[known] for name, column in columns.items()}


def _place(source: tuple[str, str, int | None]) -> tuple[str, str, int | None]:
    """Return a source without what may be left out: the slash before a topic."""
    return (source[0].lstrip('/'), *source[1:])


def _clock(read: Mapping[str, Columns], path: Path) -> str:
    """
    Choose the one clock for signals of several topics: their stamps where all have them.

    :raises BagError: where the recorder's clock cannot serve instead.
    """
    unstamped = [topic for topic, columns in read.items() if 'stamp' not in columns]
    if not unstamped:
        return 'stamp'
    for topic, columns in read.items():
        logged = columns['log_time']
        if len(logged) > 1 and logged[0] == logged[-1]:
            raise BagError(
                f'--map: {", ".join(sorted(unstamped))} has no header.stamp, and all messages'
                f' of {topic} were logged at the same instant: these topics have no clock in'
                ' common',
                path,
            )
    return 'log_time'


def hold(stamp: Places, values: Column, at: Places) -> Column:
    """
    Return the latest value at each instant, NaN before the first.

    >>> hold(np.array([10, 20]), np.array([1.0, 2.0]), np.array([5, 10, 15, 25]))
    array([nan,  1.,  1.,  2.])
    """
    if not len(stamp):
        return np.full(len(at), np.nan)
    index = np.searchsorted(stamp, at, side='right') - 1
    return np.where(index >= 0, values[index], np.nan)
