# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Alarms: what becomes of a statistic on a record that goes on."""

from dataclasses import dataclass

import numpy as np

from damadics_evaluate.columns import Floats

CLEAR_S = 30.0
"""An alarm ends when its statistic has been below the limit for that long, s."""


@dataclass(frozen=True)
class Alarm:
    """
    One alarm.

    :param start: when it was raised, s.
    :param end: when it ended, s.
    :param cause: what the detector named, empty where it names nothing.
    """

    start: float
    end: float
    cause: str = ''


def alarms_of(t: Floats, ratio: Floats) -> list[Alarm]:
    """
    Return the alarms of a statistic.

    :param t: instants, ascending, s.
    :param ratio: statistic over limit; 1 raises.
    :return: alarms; what comes again within CLEAR_S is the same one, and so is what stands at
        the last sample before a gap in the record and at the first one after it.
    """
    high = np.flatnonzero(ratio >= 1.0)
    if not high.size:
        return []
    quiet = (np.diff(high) > 1) & (np.diff(t[high]) > CLEAR_S)
    groups = np.split(t[high], np.flatnonzero(quiet) + 1)
    return [Alarm(float(group[0]), float(group[-1])) for group in groups]
