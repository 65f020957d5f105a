# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read the twin of a valve that `commission` wrote: an actuator with its constants."""

from dataclasses import fields
from pathlib import Path
from typing import NamedTuple

import yaml
from damadics_fd.core.record import Saved
from damadics_fd.core.settings.document import PLANT, ValveDocument, differing, section

from damadics_plant.actuator.parameters import LuGreActuator

ENTRY, OPERATION, SETTINGS = 'twin', 'operation', 'settings'
OF_FILE = ('actuator', 'sample_rate')  # not of the model


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


def read_twin(path: Path | str) -> LuGreActuator:
    """
    Read a twin.

    :param path: YAML file of `commission --twin`, or the valve's own file of `commission --out`.
    :return: the constants of the model.
    :raises ValueError: naming the file and every constant that is missing, unknown or wrong.
    """
    return twin_of(parts_of(path)[ENTRY], f'{path}')


def twin_of(entry: Saved, where: str) -> LuGreActuator:
    """
    Make the actuator of a twin.

    :param entry: ENTRY of a file.
    :param where: it stands, for messages.
    :return: the constants of the model.
    :raises ValueError: naming every constant that is missing, unknown or wrong.
    """
    known = {field.name for field in fields(LuGreActuator)}
    values, wrong = {}, []
    for name, value in entry.items():
        if name in OF_FILE:
            continue
        if name not in known:
            wrong.append(f'{name} is no constant of the model')
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
    if wrong:
        raise ValueError(f'{where}: {"; ".join(wrong)}')
    return LuGreActuator(**values)
