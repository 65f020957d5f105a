# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Check a saved alarm state as carefully as the request of an operator."""

import math
import reprlib
from collections.abc import Mapping

from damadics_fd.core.decision.alarm import FAILURE
from damadics_fd.core.decision.requests import LONGEST_SHELF
from damadics_fd.core.record import Plain, Saved

LATEST = 2**31 * 10**9  # ns; what fits into the stamp of a message
LONGEST = math.ceil(LONGEST_SHELF * 1e9)  # ns
STAMP = (-LATEST, LATEST)
COUNT = (0, 2**32 - 1)  # what fits into a message
RANGES = {  # of the whole numbers by name
    'stamp': STAMP,
    'history': (0, 2**63 - 1),
    'count': (0, 63),
    'worst': (0, 3),
    'occurrence': COUNT,
    'since': (0, LATEST),
    'onset': (0, LATEST),
    'pending': STAMP,
    'last_decision': STAMP,
    'excursion': STAMP,
    'near_misses': COUNT,
    'recent': STAMP,
    'shelved_until': (0, LATEST + LONGEST),
    'moved': STAMP,
    'told': (0, FAILURE),
}
FLAGS = ('active', 'latched', 'acknowledged', 'flag', 'chatter', 'unknown', 'decided')
NUMBERS = ('peak', 'excursion_peak', 'place')
LATER: Saved = {'unknown': False, 'decided': True}  # fields that states of before do not have


def complete(saved: Mapping[str, Plain]) -> Saved:
    """
    Add the fields that a state of an earlier version does not have.

    :param saved: what was saved.
    :return: the same with all fields of today.
    """
    return {**LATER, **saved}


def check(saved: Mapping[str, Plain]) -> None:
    """
    Refuse a state that no detector can have been in.

    :param saved: state by field, completed.
    :raises ValueError: naming the first field that is wrong.
    """
    for name, value in saved.items():
        for one in value if isinstance(value, list) else (value,):
            if not _fits(name, one):
                raise ValueError(f'alarm state: {name} = {reprlib.repr(value)} cannot be')
    present = saved['active'] or saved['latched']
    if saved['active'] and not saved['latched']:
        raise ValueError('alarm state: active, but not latched')
    if present and saved['occurrence'] == 0:
        raise ValueError('alarm state: an alarm without a number')
    if saved['flag'] != (present and saved['shelved_until'] == 0):
        raise ValueError('alarm state: its flag does not fit the rest')
    shelf, stamp = saved['shelved_until'], saved['stamp']
    if isinstance(shelf, int) and isinstance(stamp, int) and shelf > max(stamp, 0) + LONGEST:
        raise ValueError(f'alarm state: shelved for longer than {LONGEST_SHELF:.0f} s')


def _fits(name: str, value: Plain) -> bool:
    if name in FLAGS:
        return isinstance(value, bool)
    if name in NUMBERS:
        return isinstance(value, int | float) and math.isfinite(value) and abs(value) <= 1e12
    low, high = RANGES.get(name, (0, -1))
    return isinstance(value, int) and not isinstance(value, bool) and low <= value <= high
