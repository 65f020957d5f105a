# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read the twin of a valve that `commission` wrote: an actuator with its constants."""

from dataclasses import fields
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from damadics_fd.core.record import Plain, Saved
from damadics_fd.core.settings.document import PLANT, ValveDocument, differing, section
from damadics_fd.core.valve.plug import RECOVERY

from damadics_plant.actuator.parameters import NODES, TwinActuator

ENTRY, OPERATION, SETTINGS = 'twin', 'operation', 'settings'
OF_FILE = ('actuator', 'sample_rate')  # not of the model
TABLES = {'recovery': 12, 'errors': NODES, 'openings': NODES}  # and how many numbers each has
LOWEST = 1e-3  # of a K_m
TINY = 1e-9  # of an error or opening


class Origin(NamedTuple):
    """
    Which valve a twin is of.

    :param actuator: tag; '' where the file has none.
    :param sample_rate: of its signals [Hz]; None where the file has none that a plant can play.
    """

    actuator: str
    sample_rate: float | None


def origin(entry: Saved) -> Origin:
    """
    Tell which valve a twin is of.

    :param entry: ENTRY of a file.
    """
    tag, rate = entry.get('actuator'), entry.get('sample_rate')
    name = tag if isinstance(tag, str) else ''
    if isinstance(rate, (int, float)) and 1.0 <= rate <= 1000.0:
        return Origin(name, float(rate))
    return Origin(name, None)


def parts_of(path: Path | str) -> dict[str, Saved]:
    """
    Return the parts of a file with a twin.

    :param path: as for `read_twin`.
    :return: ENTRY; OPERATION, the pressures that the valve worked at, and SETTINGS of its
        monitor, {} where the file has none.
    :raises ValueError: naming the file, where it cannot be read or holds no twin.
    """
    try:
        content = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as problem:
        raise ValueError(f'{path} cannot be read: {problem}') from problem
    given: Saved = content if isinstance(content, dict) else {}
    if PLANT in given:  # the file of the valve itself
        settings = differing(ValveDocument.read(content).settings)
        given = section(content, PLANT) | {SETTINGS: settings}
    parts: dict[str, Saved] = {}
    for name in (ENTRY, OPERATION, SETTINGS):
        part = given.get(name)
        parts[name] = part if isinstance(part, dict) else {}
    if not parts[ENTRY]:
        raise ValueError(
            f'{path} holds no twin: write one with ros2 run damadics_fd commission '
            f'RECORDING --twin {path}'
        )
    return parts


def read_twin(path: Path | str) -> TwinActuator:
    """
    Read a twin.

    :param path: YAML file of `commission --twin`, or the valve's own file of `commission --out`.
    :return: the constants of the model.
    :raises ValueError: naming the file and every constant that is missing, unknown or wrong.
    """
    return twin_of(parts_of(path)[ENTRY], f'{path}')


def twin_of(entry: Saved, where: str) -> TwinActuator:
    """
    Make the actuator of a twin.

    :param entry: ENTRY of a file.
    :param where: it stands, for messages.
    :return: the constants of the model.
    :raises ValueError: naming every constant that is missing, unknown or wrong.
    """
    known = {field.name for field in fields(TwinActuator)}
    values: dict[str, float] = {}
    tables: dict[str, tuple[float, ...]] = {}
    wrong = []
    for name, value in entry.items():
        if name in OF_FILE:
            continue
        if name not in known:
            wrong.append(f'{name} is no constant of the model')
        if name in TABLES:
            tables[name], problem = table_of(name, value)
            wrong += problem
            continue
        number = -1.0
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            number = float(value)
        if not 0.0 <= number < 1e12:
            wrong.append(f'{name} = {value!r} is not a number >= 0')
        else:
            values[name] = number
    for name in ('stroke', 'mass', 'stiffness', 'area', 'dead_volume', 'supply', 'coulomb'):
        if not values.get(name):
            wrong.append(f'{name} is missing')
    if ('errors' in tables) != ('openings' in tables):
        wrong.append('errors and openings belong together')
    if wrong:
        raise ValueError(f'{where}: {"; ".join(wrong)}')
    return TwinActuator(
        **values,
        recovery=tables.get('recovery', RECOVERY),
        errors=tables.get('errors', ()),
        openings=tables.get('openings', ()),
    )


def table_of(name: str, value: Plain) -> tuple[tuple[float, ...], list[str]]:
    """
    Read one table of a twin.

    :param name: one of TABLES.
    :param value: of the file.
    :return: its numbers, and what is wrong with them.
    """
    count, numbers = TABLES[name], np.zeros(0)
    if isinstance(value, list) and all(type(v) in (int, float) for v in value):
        numbers = np.array([float(f'{v}') for v in value])
    good = len(numbers) == count and bool(np.isfinite(numbers).all())
    if good and name == 'recovery':
        good = bool((numbers >= LOWEST).all())
    elif good:
        rising = np.diff(numbers) if name == 'openings' else np.diff(numbers) - TINY
        good = bool((rising >= 0.0).all()) and abs(numbers[count // 2]) < TINY
        good = good and (name != 'openings' or float(np.abs(numbers).max()) <= 1.0)
    if good:
        return tuple(float(v) for v in numbers), []
    what = 'positive' if name == 'recovery' else 'rising and 0 in their middle'
    return (), [f'{name} is not {count} numbers, {what}']
