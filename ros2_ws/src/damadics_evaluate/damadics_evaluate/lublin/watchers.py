# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Detectors on a record of the plant: learn from a stated stretch, then raise alarms."""

from dataclasses import dataclass, replace

import numpy as np
from damadics_fd.core.monitor import run
from damadics_fd.core.scada.estimator import ScadaEstimator
from damadics_fd.core.settings import Settings

from damadics_evaluate.columns import NANOSECONDS, Columns, Floats, cut, rows_of, stretches
from damadics_evaluate.detectors.base import Detector
from damadics_evaluate.detectors.find import find_detector
from damadics_evaluate.lublin.judge import Alarm, alarms_of

MARGIN = 1.5
"""Limit of a baseline over its largest value on the fault-free stretch."""
GAP_S = 30.0
NAMED_AFTER_S = 60.0
MODE_SCADA = 'scada'
UNFIT = ('fixed_r1', 'fixed_r2')
"""Read residuals of the SCADA-rate monitor with the constants of another valve."""


@dataclass(frozen=True)
class Learned:
    """
    The fault-free stretch a detector learns from.

    :param start: first second of the day.
    :param end: last second; alarms count from here on.
    """

    start: float
    end: float


def watch(name: str, columns: Columns, stretch: Learned) -> list[Alarm]:
    """
    Run one detector over one record.

    :param name: of the detector, or where it is: my.py:Class.
    :param columns: record of one actuator on one day, SI.
    :param stretch: fault-free part to learn from; what lies before it is left out.
    :return: alarms after it.
    :raises ValueError: where the stretch is too short to learn from, or the detector fails.
    """
    record = cut(columns, stretch.start, np.inf)
    learning = cut(record, stretch.start, stretch.end)
    if len(learning['stamp']) < 100:
        raise ValueError(
            f'{len(learning["stamp"])} samples in {stretch.start:.0f}..{stretch.end:.0f} s: '
            'state a fault-free stretch that is recorded: --learn START-END'
        )
    if name == MODE_SCADA:
        alarms = _monitor(record, stretch)
    else:
        alarms = _statistic(find_detector(name)(), record, stretch)
    return [a for a in alarms if a.start > stretch.end - 1.0]


def _statistic(detector: Detector, record: Columns, stretch: Learned) -> list[Alarm]:
    """Fit, set the limit on the stretch, form the statistic part by part."""
    detector.prepare_for_plant()
    rows = filled(rows_of(record))
    t = rows[:, 0]
    learning = t < stretch.end
    detector.fit(rows[learning])
    values = np.zeros(len(rows))
    for part in stretches(record, GAP_S):
        values[part] = detector.statistic(rows[part])
    limit = detector.plant_limit
    if limit is None:
        limit = MARGIN * float(values[learning].max())
    if not limit > 0.0:
        raise ValueError('its statistic is 0 on all of the fault-free stretch: no limit follows')
    return [
        replace(a, cause=detector.cause(rows[t <= a.start + NAMED_AFTER_S], a.start))
        for a in alarms_of(t, values / limit)
        if a.start >= stretch.end
    ]


def filled(rows: Floats) -> Floats:
    """Return rows with every missing value replaced by the one before it."""
    out = rows.copy()
    for column in out.T:
        known = np.isfinite(column)
        if known.any():
            before = np.maximum.accumulate(np.where(known, np.arange(len(column)), 0))
            column[:] = column[before]
            column[: int(np.argmax(known))] = column[int(np.argmax(known))]
    return out


def _monitor(record: Columns, stretch: Learned) -> list[Alarm]:
    """Run mode scada as a user's replay does: it learns first, then raises alarms."""
    settings = Settings.for_mode('scada', t_learn=stretch.end - stretch.start, latch=False)
    result = run(record, settings)
    if not isinstance(result.estimator, ScadaEstimator):
        raise ValueError('mode scada is not there')
    if result.estimator.monitor.reference is None:
        raise ValueError(f'mode scada does not arm: {result.estimator.status}')
    high = np.where(result.accepted, result.decisions['fault'] != 0, False)
    alarms = alarms_of(record['stamp'] / NANOSECONDS, high.astype(np.float64))
    return [replace(a, cause=_cause(record, settings, a.start)) for a in alarms]


def _cause(record: Columns, settings: Settings, alarm: float) -> str:
    """Return what mode scada names a minute after the alarm."""
    known = run(cut(record, 0.0, alarm + NAMED_AFTER_S), settings).estimator
    isolation = known.monitor.isolate() if isinstance(known, ScadaEstimator) else None
    return ' or '.join(f'f{fault}' for fault in isolation.candidates) if isolation else ''
