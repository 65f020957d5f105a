# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Detectors on records of a plant: learn from a fault-free part, then raise alarms."""

from dataclasses import replace

import numpy as np
from damadics_fd.core.monitor import Chain, run
from damadics_fd.core.scada.estimator import ScadaEstimator
from damadics_fd.core.settings import Settings

from damadics_evaluate.alarms import Alarm, alarms_of
from damadics_evaluate.baselines import DETECTORS
from damadics_evaluate.columns import NANOSECONDS, Columns, Floats, rows_of, stretches
from damadics_evaluate.detectors.base import Detector
from damadics_evaluate.detectors.check import looks_ahead
from damadics_evaluate.detectors.find import find_detector
from damadics_evaluate.detectors.own import RefusedError

MARGIN = 1.5
"""Limit of a baseline over its largest value on the fault-free part."""
GAP_S = 30.0
APART_S = 3600.0
"""Between a fault-free record and another one that is judged by it, s."""
NAMED_AFTER_S = 60.0
FEWEST = 100
"""Samples that a detector learns from at least."""
MODE_SCADA = 'scada'
UNFIT = ('fixed_r1', 'fixed_r2', 'forest', 'mlp')
"""Bring the constants or the faults of the benchmark's valve along."""


def watch(name: str, learning: Columns, record: Columns, since: float) -> list[Alarm]:
    """
    Run one detector over one record.

    :param name: of the detector, or where it is: my.py:Class.
    :param learning: fault-free samples, SI; may be a part of the record.
    :param record: samples in order of time, SI.
    :param since: alarms from here on are returned, s.
    :return: alarms in order of time.
    :raises ValueError: where there is too little to learn from, or the detector fails.
    """
    if len(learning['stamp']) < FEWEST:
        raise ValueError(
            f'{len(learning["stamp"])} fault-free samples are recorded, {FEWEST} are needed'
        )
    if name == MODE_SCADA:
        alarms = _monitor(learning, record)
    else:
        alarms = _statistic(find_detector(name)(), learning, record, since)
    return [alarm for alarm in alarms if alarm.start >= since]


def _statistic(
    detector: Detector, learning: Columns, record: Columns, since: float
) -> list[Alarm]:
    """Fit, set the limit on the fault-free part, form the statistic part by part."""
    detector.prepare_for_plant()
    quiet, rows = filled(rows_of(learning)), filled(rows_of(record))
    detector.fit(quiet)
    values = np.zeros(len(rows))
    for part in stretches(record, GAP_S):
        values[part] = detector.statistic(rows[part])
        if detector.name not in DETECTORS:
            ahead = looks_ahead(detector, rows[part], values[part])
            if ahead:
                raise RefusedError(ahead)
    limit = detector.plant_limit
    if limit is None:
        limit = MARGIN * max(
            float(detector.statistic(quiet[part]).max()) for part in stretches(learning, GAP_S)
        )
    if not limit > 0.0:
        raise ValueError('its statistic is 0 on all of the fault-free part: no limit follows')
    t = rows[:, 0]
    return [
        replace(a, cause=detector.cause(rows[t <= a.start + NAMED_AFTER_S], a.start))
        for a in alarms_of(t[t >= since], values[t >= since] / limit)
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


def _monitor(learning: Columns, record: Columns) -> list[Alarm]:
    """Run mode scada as a user's replay does: it learns first, then raises alarms."""
    whole = learning_first(learning, record)
    later = max(int(NANOSECONDS) - int(whole['stamp'][0]), 0)  # no stamp is before 0
    whole['stamp'] = whole['stamp'] + later
    length = (learning['stamp'][-1] - learning['stamp'][0]) / NANOSECONDS + 1.0
    settings = Settings.for_mode('scada', t_learn=float(round(length)), latch=False)
    result = run(whole, settings)
    if not isinstance(result.estimator, ScadaEstimator):
        raise ValueError('mode scada is not there')
    if result.estimator.monitor.reference is None:
        raise ValueError(f'mode scada does not arm: {result.estimator.status}')
    judged = result.accepted  # a sample that is refused neither raises an alarm nor ends one
    high = result.decisions['fault'][judged] != 0
    alarms = alarms_of(whole['stamp'][judged] / NANOSECONDS, high.astype(np.float64))
    seconds = later / NANOSECONDS
    return [
        replace(a, start=a.start - seconds, end=a.end - seconds)
        for a in _with_causes(whole, settings, alarms)
    ]


def learning_first(learning: Columns, record: Columns) -> Columns:
    """
    Return a record that begins with its fault-free part.

    Where that part lies within, what comes before it is left out; where it is of another record,
    its stamps are moved to an hour before this one: the valve is not where that record left it.
    """
    first, last = learning['stamp'][0], learning['stamp'][-1]
    names = learning.keys() & record.keys()
    early = {name: learning[name] for name in names}
    stamp = record['stamp']
    if stamp[0] <= first <= stamp[-1]:
        rest = {name: record[name][stamp > last] for name in names}
    else:
        rest = {name: record[name] for name in names}
        early['stamp'] = learning['stamp'] + (stamp[0] - last - int(APART_S * NANOSECONDS))
    return {name: np.concatenate((early[name], rest[name])) for name in names}


def _with_causes(whole: Columns, settings: Settings, alarms: list[Alarm]) -> list[Alarm]:
    """Run once more, piece by piece, and ask mode scada a minute after each alarm."""
    chain = Chain(settings)
    named, done = [], 0
    for alarm in alarms:
        until = (alarm.start + NAMED_AFTER_S) * NANOSECONDS
        end = int(np.searchsorted(whole['stamp'], until, side='right'))
        if end > done:
            chain.run({name: values[done:end] for name, values in whole.items()})
            done = end
        estimator = chain.estimator
        isolation = estimator.monitor.isolate() if isinstance(estimator, ScadaEstimator) else None
        cause = ' or '.join(f'f{fault}' for fault in isolation.candidates) if isolation else ''
        named.append(replace(alarm, cause=cause))
    return named
