# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a recording has to hold, from a YAML file: for use in CI."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from damadics_fd.bag.checking.inspection import Report
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.rosbag2 import Yaml, load_yaml

MEASURES = {  # in a file of expectations: what it is, and whether a bare number is the most
    'count': False,
    'rate': False,
    'period': False,
    'duration': False,
    'max_gap': True,
    'jitter': True,
    'gaps': True,
    'duplicates': True,
    'zero_stamps': True,
    'steps_back': True,
    'late_start': True,
}
EXAMPLE = """topics:
  /measurement:
    type: damadics_msgs/msg/Measurement
    count: [1000, .inf]   # from, to; a bare number: exactly
    rate: [195, 205]      # [1/s]
    max_gap: 0.1          # [s] at most; so do jitter, gaps, duplicates, zero_stamps, late_start"""


@dataclass(frozen=True)
class Bounds:
    """Least and greatest value that is good."""

    least: float
    most: float


@dataclass(frozen=True)
class Expected:
    """What a topic has to be: `bounds` by measure."""

    topic: str
    type: str
    bounds: Mapping[str, Bounds]


def read_expectations(path: Path) -> list[Expected]:
    """
    Read what topics have to be.

    :param path: YAML, as in `EXAMPLE`.
    :raises BagError: where it cannot be read or asks for what there is not.
    """
    try:
        loaded = load_yaml(path.read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError) as error:
        raise BagError(f'cannot be read: {error}', path) from error
    topics = loaded.get('topics') if isinstance(loaded, dict) else None
    if not isinstance(topics, dict):
        raise BagError(f'has no topics; write\n{EXAMPLE}', path)
    found = []
    for name, asked in topics.items():
        if not isinstance(asked, dict):
            raise BagError(f'{name}: write measures below it, such as count: 1000', path)
        unknown = sorted(asked.keys() - MEASURES.keys() - {'type'})
        if unknown:
            raise BagError(
                f'{name}: there is no {", ".join(unknown)}; there are type, {", ".join(MEASURES)}',
                path,
            )
        kind = asked.get('type', '')
        bounds = {m: _bounds(path, m, value) for m, value in asked.items() if m != 'type'}
        found.append(Expected(name, kind if isinstance(kind, str) else '', bounds))
    return found


def _bounds(path: Path, measure: str, value: Yaml) -> Bounds:
    try:
        if isinstance(value, list):
            least, most = value
            return Bounds(_number(least), _number(most))
        number = _number(value)
    except (ValueError, TypeError):
        raise BagError(f'{measure}: write a number, or [FROM, TO]', path) from None
    return Bounds(float('-inf') if MEASURES[measure] else number, number)


def _number(value: Yaml) -> float:
    if not isinstance(value, str):
        raise TypeError
    return float(value.replace('.inf', 'inf'))


def measures(report: Report, topic: str) -> dict[str, float]:
    """Return the measures of a topic, in seconds where they are times."""
    timing = report.topics[topic].timing
    return {
        'count': timing.count,
        'rate': timing.rate,
        'period': timing.period,
        'duration': (timing.end - timing.start) / 1e9,
        'max_gap': timing.max_gap / 1e9,
        'jitter': timing.jitter,
        'gaps': timing.gaps,
        'duplicates': timing.duplicates,
        'zero_stamps': timing.zero_stamps,
        'steps_back': timing.steps_back,
        'late_start': (timing.start - report.start) / 1e9 if timing.count else 0.0,
    }


def unmet(report: Report, expected: list[Expected]) -> list[str]:
    """Tell what a recording is not, one sentence each."""
    told = []
    for wish in expected:
        if wish.topic not in report.topics:
            told.append(f'{wish.topic}: expected, and not there')
            continue
        kind = report.topics[wish.topic].type
        if wish.type and wish.type != kind:
            told.append(f'{wish.topic}: type {kind}, expected {wish.type}')
        found = measures(report, wish.topic)
        told += [
            f'{wish.topic}: {name} {found[name]:g}, expected {_words(bounds)}'
            for name, bounds in wish.bounds.items()
            if not bounds.least <= found[name] <= bounds.most
        ]
    return told


def _words(bounds: Bounds) -> str:
    if bounds.least == bounds.most:
        return f'{bounds.most:g}'
    if bounds.least == float('-inf'):
        return f'at most {bounds.most:g}'
    return f'{bounds.least:g} to {bounds.most:g}'
