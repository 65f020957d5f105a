# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Identify a valve for mode scada: check what was recorded, then learn stem and flow."""

from collections.abc import Collection, Sequence

import numpy as np

from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.core.scada.laws.identify import identify as identify_valve
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.identified import FaultFree, Identified

LEAST = 1800.0  # s of records: half an hour
NEEDED = ('cv', 'x1')


def identify(
    recordings: Sequence[FaultFree], sheet: Settings, given: Collection[str]
) -> Identified:
    """
    Learn stem and flow of a valve; learned from the first half, the second is watched.

    :param recordings: fault-free records of one valve.
    :param sheet: settings of mode scada with what is known of the valve.
    :param given: names of the settings that the user stated.
    :return: settings, verdict, and what was learned.
    :raises CommissioningError: where too little was recorded.
    """
    duration = 0.0
    for recording in recordings:
        for name in NEEDED:
            signal = recording.columns.get(name)
            if signal is None or not np.isfinite(np.asarray(signal, float)).any():
                raise CommissioningError(
                    f'{name} is not measured in {recording.name}: mode scada needs cv and x1'
                )
        stamp = np.asarray(recording.columns['stamp'], np.int64)
        duration += float(stamp[-1] - stamp[0]) * 1e-9
    if duration < LEAST:
        raise CommissioningError(
            f'{duration:.0f} s were recorded, {LEAST:.0f} s are needed: half to learn from, half '
            'to check what was learned'
        )
    return identify_valve(recordings, sheet, given)
