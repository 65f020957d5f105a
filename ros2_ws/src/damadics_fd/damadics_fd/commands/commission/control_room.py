# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Identify a valve for mode scada: learn from the first half, judge the second by it."""

from collections.abc import Collection, Sequence

import numpy as np

from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.commands.commission.monitor import joined
from damadics_fd.commands.commission.signals import sample_rate
from damadics_fd.core.identified import LIMITED, OK, REFUSED, FaultFree, Identified
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.document import differing

LEAST = 1800.0  # s of records: half an hour
NEEDED = ('cv', 'x1')
USEFUL = ('p1', 'p2', 'flow', 't1')


def identify(
    recordings: Sequence[FaultFree], sheet: Settings, given: Collection[str]
) -> Identified:
    """
    Learn stem and flow from the first half of the records and watch the second.

    :param recordings: fault-free records of one valve.
    :param sheet: settings of mode scada with what is known of the valve.
    :param given: names of the settings that the user stated.
    :return: settings, verdict, and what was learned.
    :raises CommissioningError: where too little was recorded.
    """
    columns = joined(recordings)
    for name in NEEDED:
        if name not in columns or not np.isfinite(np.asarray(columns[name], float)).any():
            raise CommissioningError(f'{name} is not measured: mode scada needs cv and x1')
    stamp = np.asarray(columns['stamp'], np.int64)
    duration = float(stamp[-1] - stamp[0]) * 1e-9
    if duration < LEAST:
        raise CommissioningError(
            f'{duration:.0f} s were recorded, {LEAST:.0f} s are needed: half to learn from, half '
            'to check what was learned'
        )
    rate = sample_rate(stamp)
    changes = {} if 'sample_rate' in given else {'sample_rate': rate}
    if 't_learn' not in given:
        changes['t_learn'] = float(f'{duration / 2.0:.4g}')
    settings = sheet.replace(**changes)
    result = run(columns, settings)
    status = result.estimator.status
    missing = [
        name
        for name in USEFUL
        if name not in columns or not np.isfinite(np.asarray(columns[name], float)).any()
    ]
    reasons = []
    if missing:
        reasons.append(f'{", ".join(missing)} not measured: what rests on them is not watched')
    if result.detections:
        reasons.append(
            f'the second half raises {len(result.detections)} alarms: a fault in it, or loads '
            'that the first half does not show'
        )
    if not result.estimator.monitoring:
        reasons.append(f'nothing was learned: {status}')
    verdict = LIMITED if reasons else OK
    if not result.estimator.monitoring:
        verdict = REFUSED
    report = (
        f'{rate:g} Hz, {duration / 3600.0:.2f} h in {len(recordings)} recordings; learned from '
        f'{settings.t_learn / 3600.0:.2f} h: {status}',
        *(f'because: {reason}' for reason in reasons),
        f'verdict: {verdict}',
    )
    learned = result.estimator.learned() if result.estimator.monitoring else {}
    return Identified(verdict, differing(settings), report, tuple(reasons), learned)
