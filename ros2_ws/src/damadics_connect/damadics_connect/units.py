# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""From the plant's units to those of `Measurement`, with the words of `--map`."""

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.mapping import SHARES, Scale, parse_source, unit_scale

from damadics_connect.settings import Section


def read_scale(section: Section, signal: str) -> Scale:
    """
    Read how a signal is scaled.

    :param section: with some of `unit`, `factor`, `offset`, `invert`.
    :param signal: field of `Measurement`.
    :return: the scale.
    """
    scale = Scale()
    if unit := section.text('unit'):
        try:
            scale = unit_scale(signal, unit)
        except BagError as problem:
            section.problems.append(f'{section.where}.unit: {problem.reason}')
    own = section.number('factor', 1.0, -1e12, 1e12)
    scale = scale.then(Scale(own, section.number('offset', 0.0, -1e12, 1e12)))
    if section.flag('invert'):
        if signal not in SHARES:
            section.refuse('invert', f'is for {" and ".join(SHARES)}: 1 minus the value')
        scale = scale.then(Scale(-1.0, 1.0))
    if not own:
        section.refuse('factor', 'is 0: every value would be the same')
    return scale


def read_source(section: Section, signal: str, text: str) -> tuple[str, Scale]:
    """
    Read the short form of a signal: `SOURCE[UNIT]*FACTOR+OFFSET invert`.

    :param section: takes mistakes.
    :param signal: field of `Measurement`.
    :param text: what stands behind it.
    :return: the source and its scale.
    """
    try:
        source = parse_source(signal, text)
    except BagError as problem:
        section.problems.append(f'{section.where}.{signal}: {problem.reason}')
        return text, Scale()
    return source.name, source.scale
