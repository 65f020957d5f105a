# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Stamps: nanoseconds, from 1970 or from the start of a simulated run."""

SECOND = 1_000_000_000  # ns
DATE = 10**17  # ns; a stamp from here on (March 1973) is a date, a smaller one counts from zero


def is_date(stamp: int) -> bool:
    """
    Tell whether a stamp is a date, not the time since the start of a simulated run.

    :param stamp: stamp [ns].
    :return: True for a date.
    """
    return abs(stamp) >= DATE


def origin(first: int) -> int:
    """
    Return the stamp that tables and figures of a recording call 0 s.

    :param first: first stamp of the recording [ns].
    :return: `first` where it is a date; 0 for a simulated run, which counts from its own zero.
    """
    return first if is_date(first) else 0


def another_run(last: int, stamp: int) -> bool:
    """
    Tell whether a stamp belongs to another run than the last one that is known.

    :param last: last stamp that was saved [ns].
    :param stamp: first stamp after it [ns].
    :return: True where both count from the start of a simulated run and the stamp is earlier.
    """
    return not is_date(last) and stamp < last
