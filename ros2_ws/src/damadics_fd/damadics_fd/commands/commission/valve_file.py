# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The file of a valve: what differs from the defaults, tag and reference, verdict, twin."""

from collections.abc import Iterator, Mapping

from damadics_fd.core.record import Plain
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.document import (
    COMMISSION,
    ESTIMATOR,
    EVERY_NODE,
    PARAMETERS,
    PLANT,
)
from damadics_fd.core.settings.identified import Identified

WIDTH = 96


def parameter_file(
    found: Identified, mode: str, source: str, actuator: str = '', reference: str = ''
) -> str:
    """
    Return a parameter file for nodes, replay, fleet, page and plant.

    :param found: what commission found.
    :param mode: monitor or scada.
    :param source: the recordings, for people.
    :param actuator: tag of the valve, '' where it was not given.
    :param reference: path of the reference, '' for none.
    :return: YAML.
    """
    lines = [f'# proposed by commission from {source}', f'# verdict: {found.verdict}']
    for line in found.report:
        if not line.startswith('verdict'):
            lines += [f'# {part}' for part in _wrapped(line)]
    lines += [f'{EVERY_NODE}:', f'  {PARAMETERS}:', f'    mode: {mode}']
    if actuator:
        lines.append(f'    actuator: {quoted(actuator)}')
    described = {row['name']: row for row in Settings.describe(mode)}
    for name in described:
        if name == 'mode' or name not in found.settings:
            continue
        row = described[name]
        unit = f' [{row["unit"]}]' if row['unit'] else ''
        lines += [
            f'    # {row["description"]}{unit}',
            f'    {name}: {value_text(found.settings[name])}',
        ]
    if reference:
        lines += _section(ESTIMATOR, {'reference': reference})
    lines += _section(COMMISSION, found.judgement())
    if found.twin:
        lines += _section(PLANT, found.twin)
    return '\n'.join(lines) + '\n'


def _section(node: str, parameters: Mapping[str, Plain]) -> Iterator[str]:
    yield f'{node}:'
    yield f'  {PARAMETERS}:'
    yield from rows(parameters, '    ')


def rows(values: Mapping[str, Plain], indent: str) -> Iterator[str]:
    """
    Write a mapping in block style.

    :param values: by name; mappings within it, too.
    :param indent: what each line begins with.
    :return: lines of YAML.
    """
    for name, value in values.items():
        if isinstance(value, dict):
            yield f'{indent}{name}:'
            yield from rows(value, f'{indent}  ')
        elif isinstance(value, list) and value and all(isinstance(v, str) for v in value):
            yield f'{indent}{name}:'
            yield from (f'{indent}- {quoted(str(v))}' for v in value)
        else:
            yield f'{indent}{name}: {value_text(value)}'


def value_text(value: Plain) -> str:
    """
    Return a value as both YAML and ROS read it: a float never looks like a whole number.

    :param value: of a setting.
    :return: its text.
    """
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        text = repr(value)
        return text.replace('e', '.0e') if 'e' in text and '.' not in text else text
    if isinstance(value, str):
        return quoted(value) if not value.isidentifier() else value
    if isinstance(value, list):
        return '[' + ', '.join(value_text(v) for v in value) + ']'
    raise ValueError(f'{value!r} is no parameter')


def quoted(text: str) -> str:
    """
    Return a text as YAML never takes for a number or a sign of its own.

    :param text: of one line.
    :return: in single quotes.
    """
    return "'" + ' '.join(text.split()).replace("'", "''") + "'"


def _wrapped(line: str) -> list[str]:
    words, rows = line.split(), ['']
    for word in words:
        if rows[-1] and len(rows[-1]) + len(word) > WIDTH:
            rows.append('  ')
        rows[-1] += word if rows[-1].strip() == '' else f' {word}'
    return rows
