# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read one JSON object of a message, whoever has sent it."""

import json
import math
from datetime import datetime

from damadics_fd.core.text import NAME, plain

from damadics_connect.mqtt.sparkplug import PayloadError
from damadics_connect.source_clock import NANO

LARGEST = 1_000_000  # bytes of a message
UNITS = {'s': NANO, 'ms': 1_000_000, 'us': 1000, 'ns': 1}
LATEST = 2**62  # ns


def limited(payload: object) -> bytes:
    """Return the bytes of a payload; refuse too many."""
    if not isinstance(payload, bytes | bytearray):
        return b''
    if len(payload) > LARGEST:
        raise PayloadError(f'{len(payload)} bytes: a message has at most {LARGEST}')
    return bytes(payload)


def parsed(payload: object) -> dict[str, object]:
    """Return the object in a payload; refuse everything else with a short word."""
    try:
        content = json.loads(limited(payload))
    except PayloadError:
        raise
    except (ValueError, RecursionError) as problem:
        raise ValueError('not JSON') from problem
    if not isinstance(content, dict):
        raise ValueError('JSON, but not an object such as {"stamp": ..., "cv": ...}')
    return content


def field_at(content: dict[str, object], path: str) -> object:
    """Find a field, also one inside others: `position.value`."""
    if path in content:
        return content[path]
    found: object = content
    for part in path.split('.'):
        found = found.get(part) if isinstance(found, dict) else None
    return found


def number_or_word(value: object) -> float | str:
    """Return a number; NaN for none; a text that says what it is instead."""
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, int | float):
        return f'{plain(type(value).__name__, NAME)} where a number is expected'
    try:
        return float(value)
    except OverflowError:
        return 'a number that is too large'


def stamp_of(given: object, field: str, unit: str) -> int:
    """
    Read the source time of a message.

    :param given: its value.
    :param field: its name.
    :param unit: one of `UNITS`, or `iso` for a text.
    :return: [ns since 1970].
    :raises ValueError: where it is no time; says what is wanted.
    """
    try:
        if unit == 'iso':
            when = datetime.fromisoformat(str(given))
            if when.tzinfo is None:
                raise ValueError
            stamp = round(when.timestamp() * 1e6) * 1000
        elif isinstance(given, bool) or not isinstance(given, int | float):
            raise ValueError
        elif isinstance(given, int):
            stamp = given * UNITS[unit]
        else:
            stamp = round(given * UNITS[unit])
    except (ValueError, OverflowError):
        wanted = 'ISO 8601 with a time zone' if unit == 'iso' else f'a number in {unit}'
        raise ValueError(f'{field} is not {wanted}') from None
    if not 0 < stamp < LATEST:
        raise ValueError(f'{field} is out of range for {unit}')
    return stamp
