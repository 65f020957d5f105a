# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios x detectors x seeds: one unit of work, its result, the settings that made it."""

import hashlib
import json
import math
import platform
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from damadics_fd.core.scada.isolation import Isolation, group_of

from damadics_evaluate.baselines import DETECTORS
from damadics_evaluate.baselines.base import Floats
from damadics_evaluate.baselines.scada import Scada
from damadics_evaluate.indices import (
    decision_indices,
    diagnosis_accuracy,
    misisolation_rate,
)
from damadics_evaluate.trajectories import (
    NOISE,
    SCENARIOS,
    Case,
    case,
    learning_hour,
    nominal_day,
    scenario_run,
)

FACTORS = np.geomspace(0.25, 4.0, 33)  # of the limit, for the ROC and DET curves
MARGIN = 1.1  # limit of a calibrated detector over its largest value on nominal days
CALIBRATION_SEED = 1_000_100
NOMINAL_SEED = 2_000_048  # the days before it set the margins of the tests
ISOLATE_AFTER = (60, 300)  # s after the alarm
SETTLED_AFTER = 600.0  # s after the alarm, the diagnosis that is judged
LATE_ISOLATIONS = 1  # in equal parts of what is left of the run
LIBRARIES = ('numpy', 'numba', 'river', 'filterpy', 'scikit-learn')


@dataclass(frozen=True)
class Campaign:
    """
    What is to be run.

    :param scenarios: names of standard scenarios.
    :param detectors: names of detectors.
    :param seeds: seeds of the runs.
    :param calibration_days: fault-free days that set the limits of the baselines.
    :param nominal_days: further fault-free days on which false alarms are counted.
    :param debounce: consecutive samples at or above the limit that make a decision.
    :param isolated_seeds: isolation, the dearest part, runs for that many of the seeds.
    """

    scenarios: tuple[str, ...] = SCENARIOS
    detectors: tuple[str, ...] = tuple(DETECTORS)
    seeds: tuple[int, ...] = (0,)
    calibration_days: int = 3
    nominal_days: int = 0
    debounce: int = 1
    isolated_seeds: int = 5

    def __post_init__(self) -> None:
        """Refuse unknown names, all in one message."""
        wrong = [f'no detector {name}' for name in self.detectors if name not in DETECTORS]
        if wrong:
            raise ValueError(f'{"; ".join(wrong)}: detectors are {", ".join(DETECTORS)}')
        for name in self.scenarios:
            case(name)
        for name in ('calibration_days', 'debounce'):
            if getattr(self, name) < 1:
                raise ValueError(f'{name} is {getattr(self, name)}: give 1 or more')

    def settings_hash(self, detector: str) -> str:
        """Return a hash of everything but scenario and seed that shapes a detector's results."""
        shape = {
            'detector': detector,
            'settings': DETECTORS[detector]().settings(),
            'calibration_days': self.calibration_days,
            'debounce': self.debounce,
            'margin': MARGIN,
            'noise': NOISE,
        }
        text = json.dumps(shape, sort_keys=True, default=str)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def versions() -> dict[str, str]:
    """Return the versions of this package and of the libraries that took part."""
    found = {'python': platform.python_version()}
    for package in ('damadics_fd', *LIBRARIES):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = 'source' if package == 'damadics_fd' else 'absent'
    return found


def nominal_unit(campaign: Campaign, seed: int) -> list[dict[str, Any]]:
    """
    Run every detector over one fault-free day.

    :param seed: CALIBRATION_SEED + n or NOMINAL_SEED + n.
    :return: per detector the largest statistic of every hour.
    """
    hour, day = learning_hour(seed), nominal_day(seed)
    results = []
    for name in campaign.detectors:
        detector = DETECTORS[name]()
        if seed < NOMINAL_SEED and not detector.calibrated:
            continue
        started = time.perf_counter()
        detector.fit(hour)
        statistic = debounced(detector.statistic(day), campaign.debounce)
        results.append(
            {
                'kind': 'nominal',
                'detector': name,
                'seed': seed,
                'hourly_max': statistic.reshape(24, -1).max(axis=1).tolist(),
                'seconds': round(time.perf_counter() - started, 3),
                'settings_hash': campaign.settings_hash(name),
            }
        )
    return results


def limits(campaign: Campaign, nominal: Sequence[dict[str, Any]]) -> dict[str, float]:
    """
    Return the limit of every detector: no alarm on the calibration days, with a margin.

    :param nominal: results of `nominal_unit` on the calibration days.
    :return: limit by detector; 1 for the detectors that bring their own.
    """
    found = {}
    for name in campaign.detectors:
        if not DETECTORS[name].calibrated:
            found[name] = 1.0
            continue
        peaks = [
            max(r['hourly_max'])
            for r in nominal
            if r['detector'] == name and r['seed'] < NOMINAL_SEED
        ]
        found[name] = MARGIN * max(peaks)
    return found


def scenario_unit(
    campaign: Campaign, limit: dict[str, float], name: str, seed: int
) -> list[dict[str, Any]]:
    """
    Run every detector over one scenario under one seed.

    :param limit: limits by detector.
    :param name: scenario; seed of the run.
    :return: one result per detector, plain data.
    """
    scenario = case(name)
    hour = learning_hour(seed)
    samples, strength = scenario_run(name, seed)
    results = []
    for detector_name in campaign.detectors:
        detector = DETECTORS[detector_name]()
        started = time.perf_counter()
        detector.fit(hour)
        statistic = debounced(detector.statistic(samples), campaign.debounce)
        ratio = statistic / limit[detector_name]
        decision = np.maximum.accumulate(ratio >= 1.0)  # latched, as an alarm is
        t = samples[:, 0]
        result: dict[str, Any] = {
            'kind': 'scenario',
            'scenario': name,
            'fault': scenario.fault,
            'seed': seed,
            'detector': detector_name,
            'limit': limit[detector_name],
            'settings_hash': campaign.settings_hash(detector_name),
            'indices': _plain(asdict(decision_indices(t, decision, scenario.zones, strength))),
            'crossings': _crossings(t, ratio),
        }
        if isinstance(detector, Scada) and not detector.calibrated:
            result['test'] = detector.first_test()
            result['signature'] = detector.signature()
            if seed in campaign.seeds[: campaign.isolated_seeds]:
                result['isolation'] = isolation_result(detector, scenario, samples, strength)
        result['seconds'] = round(time.perf_counter() - started, 3)
        results.append(result)
    return results


def debounced(statistic: Floats, count: int) -> Floats:
    """
    Return the smallest of the last `count` values: at the limit only if all of them are.

    >>> debounced(np.array([0.0, 5.0, 0.0, 4.0, 6.0]), 2).tolist()
    [0.0, 0.0, 0.0, 0.0, 4.0]
    """
    if count == 1:
        return statistic
    padded = np.concatenate((np.zeros(count - 1), statistic))
    return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, count).min(axis=1))


def _crossings(t: Floats, ratio: Floats) -> list[float | None]:
    """Return when the ratio first reaches each of FACTORS, None where it never does."""
    highest = np.maximum.accumulate(ratio)
    index = np.searchsorted(highest, FACTORS)
    return [float(t[i]) if i < len(t) else None for i in index]


def isolation_result(
    detector: Scada, scenario: Case, samples: Floats, strength: Floats
) -> dict[str, Any] | None:
    """
    Follow the isolation after the alarm and return its indices.

    :param detector: the monitor, after its statistic was formed.
    :return: diagnoses over time, indices of PID and CID; None without an alarm.
    """
    alarm = detector.alarm_time()
    if alarm is None:
        return None
    t = samples[:, 0]
    late = np.linspace(alarm, t[-1], LATE_ISOLATIONS + 1)[1:]
    times = sorted({*(alarm + after for after in ISOLATE_AFTER), *np.floor(late)})
    times = [float(at) for at in times if at <= t[-1]]
    found = detector.isolate_at(samples, times)
    diagnoses = [_diagnosis(i) for i in found]
    if not diagnoses:
        return None
    primary, complementary = np.zeros(len(t), bool), np.zeros(len(t), bool)
    for diagnosis in diagnoses:
        since = t >= diagnosis['t']
        primary[since] = diagnosis['ranking'][0][0] == scenario.fault
        complementary[since] = not primary[since][0]
    named = [d['candidates'] for d in diagnoses]
    dacc_tm, dacc = diagnosis_accuracy(named, scenario.fault)
    twins = decision_indices(t, primary, scenario.zones, strength).as_isolation()
    settled = [d for d in diagnoses if d['t'] <= alarm + SETTLED_AFTER][-1]
    return {
        'diagnoses': diagnoses,
        'right_group': settled['group'] == group_of(scenario.fault),
        'right_first': settled['ranking'][0][0] == scenario.fault,
        'indices': _plain(
            {
                **twins,
                'r_mi': misisolation_rate(t, complementary, scenario.zones),
                'dacc_tm': dacc_tm,
                'dacc': dacc,
            }
        ),
    }


def _diagnosis(isolation: Isolation) -> dict[str, Any]:
    return {
        't': isolation.t,
        'group': isolation.group,
        'candidates': list(isolation.candidates),
        'ranking': [
            [h.fault, round(h.strength, 4), round(h.cost - isolation.best.cost, 2)]
            for h in isolation.ranking[:5]
        ],
    }


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    """Return the values with None for NaN, as JSON has it."""
    return {
        key: None if isinstance(value, float) and math.isnan(value) else value
        for key, value in values.items()
    }
