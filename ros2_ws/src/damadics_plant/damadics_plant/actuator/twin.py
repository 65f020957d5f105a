# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read the twin of a valve that `commission --twin` wrote: an actuator with its constants."""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

import yaml

from damadics_plant.actuator.parameters import LuGreActuator

ENTRY = 'twin'
OF_FILE = ('actuator', 'sample_rate')  # not of the model


def read_twin(path: Path | str) -> LuGreActuator:
    """
    Read a twin.

    :param path: YAML file of `commission --twin`.
    :return: the constants of the model.
    :raises ValueError: naming the file and every constant that is missing, unknown or wrong.
    """
    try:
        content = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as problem:
        raise ValueError(f'{path} cannot be read: {problem}') from problem
    given = content.get(ENTRY) if isinstance(content, Mapping) else None
    if not isinstance(given, Mapping):
        raise ValueError(
            f'{path} holds no twin: write one with ros2 run damadics_fd commission '
            f'RECORDING --twin {path}'
        )
    known = {field.name for field in fields(LuGreActuator)}
    values = {name: value for name, value in given.items() if name not in OF_FILE}
    wrong = [f'{name} is no constant of the model' for name in values if name not in known]
    for name, value in values.items():
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not (number and 0.0 <= value < 1e12):
            wrong.append(f'{name} = {value!r} is not a number >= 0')
    for name in ('stroke', 'mass', 'stiffness', 'area', 'dead_volume', 'supply', 'coulomb'):
        if not values.get(name):
            wrong.append(f'{name} is missing')
    if wrong:
        raise ValueError(f'{path}: {"; ".join(wrong)}')
    return LuGreActuator(**{name: float(value) for name, value in values.items()})
