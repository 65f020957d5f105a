# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read one JSON object of a message, whoever has sent it."""

import json
import math

from damadics_fd.core.text import NAME, plain

from damadics_connect.mqtt.sparkplug import PayloadError

LARGEST = 1_000_000  # bytes of a message


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
