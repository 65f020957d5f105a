# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""One unit of work of a campaign: every detector over one fault-free day, or one scenario."""

import hashlib
import math
import time
from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from damadics_evaluate.baselines.scada import Scada
from damadics_evaluate.benchmark.campaign import MARGIN, NOMINAL_SEED, Campaign
from damadics_evaluate.benchmark.isolation import isolation_result
from damadics_evaluate.benchmark.results import Limits, Result, plain
from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import Detector
from damadics_evaluate.detectors.find import find_detector
from damadics_evaluate.detectors.own import RefusedError
from damadics_evaluate.indices import decision_indices
from damadics_evaluate.scenarios.cases import NOMINAL, Case, case
from damadics_evaluate.scenarios.trajectories import learning_hour, nominal_day, scenario_run

FACTORS = np.geomspace(0.25, 4.0, 33)  # of the limit, for the ROC and DET curves
OWN_FEED_HOURS = 3  # fault-free hours that set a limit under inputs of one's own
OWN_FEED_SEED = 500_000


def nominal_unit(campaign: Campaign, seed: int) -> list[Result]:
    """
    Run every detector over one fault-free day.

    :param seed: CALIBRATION_SEED + n or NOMINAL_SEED + n.
    :return: per detector the largest statistic of every hour.
    """
    hour, day = learning_hour(seed), nominal_day(seed)
    results: list[Result] = []
    for name in campaign.detectors:
        detector = find_detector(name)()
        if seed < NOMINAL_SEED and not detector.calibrated:
            continue
        started = time.perf_counter()
        try:
            detector.fit(hour)
            statistic = debounced(detector.statistic(day), campaign.debounce)
        except RefusedError as error:
            results.append(_refused(campaign, name, 'nominal', seed, error))
            continue
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


def _refused(
    campaign: Campaign, name: str, scenario: str, seed: int, error: RefusedError
) -> Result:
    return {
        'kind': 'refused',
        'scenario': scenario,
        'detector': name,
        'seed': seed,
        'reason': str(error),
        'settings_hash': campaign.settings_hash(name),
    }


def limits(campaign: Campaign, nominal: Sequence[Result]) -> Limits:
    """
    Return the limit of every detector: no alarm on the calibration days, with a margin.

    :param nominal: results of `nominal_unit` on the calibration days.
    :return: limit by detector; 1 for the detectors that bring their own.
    """
    found = {}
    for name in campaign.detectors:
        if not find_detector(name).calibrated:
            found[name] = 1.0
            continue
        peaks = [
            max(r['hourly_max'])
            for r in nominal
            if r['detector'] == name and r['kind'] == 'nominal' and r['seed'] < NOMINAL_SEED
        ]
        if peaks:
            found[name] = MARGIN * max(peaks)
    return found


def scenario_unit(campaign: Campaign, limit: Limits, name: str, seed: int) -> list[Result]:
    """
    Run every detector over one scenario under one seed.

    :param limit: limits by detector; those without one are left out.
    :param name: scenario; seed of the run.
    :return: one result per detector, plain data.
    """
    scenario = case(name)
    hour = learning_hour(seed, scenario.feed)
    samples, strength = scenario_run(name, seed)
    data_hash = hashlib.sha256(samples.tobytes()).hexdigest()[:12]
    results: list[Result] = []
    for detector_name in campaign.detectors:
        if detector_name not in limit:
            continue
        detector = find_detector(detector_name)()
        detector.t_on = scenario.zones.t_on
        started = time.perf_counter()
        try:
            detector.fit(hour)
            bound = limit[detector_name]
            if detector.calibrated and scenario.feed != NOMINAL:
                bound = _own_limit(detector, scenario, campaign.debounce)
            statistic = debounced(detector.statistic(samples), campaign.debounce)
            result = _judged(campaign, scenario, seed, statistic, bound, samples, strength)
            result |= {
                'detector': detector_name,
                'settings_hash': campaign.settings_hash(detector_name),
                'data_hash': data_hash,
            }
            if isinstance(detector, Scada):
                result |= {'test': detector.first_test(), 'signature': detector.signature()}
            if seed in campaign.seeds[: campaign.isolated_seeds]:
                alarm = result['alarm']
                result['isolation'] = isolation_result(
                    detector, scenario, alarm, samples, strength
                )
        except RefusedError as error:
            results.append(_refused(campaign, detector_name, name, seed, error))
            continue
        result['seconds'] = round(time.perf_counter() - started, 3)
        results.append(result)
    return results


def _judged(
    campaign: Campaign,
    scenario: Case,
    seed: int,
    statistic: Floats,
    bound: float,
    samples: Floats,
    strength: Floats,
) -> Result:
    """Return the indices of one statistic; decisions are latched, as an alarm is."""
    ratio = statistic / bound
    decision = np.maximum.accumulate(ratio >= 1.0)
    t = samples[:, 0]
    return {
        'kind': 'scenario',
        'scenario': scenario.name,
        'fault': scenario.fault,
        'seed': seed,
        'limit': bound,
        'alarm': float(t[np.argmax(decision)]) if decision.any() else None,
        'indices': plain(asdict(decision_indices(t, decision, scenario.zones, strength))),
        'crossings': _crossings(t, ratio),
    }


def _own_limit(detector: Detector, scenario: Case, debounce: int) -> float:
    """Return the limit of a fitted detector under inputs of one's own."""
    peaks = [
        float(debounced(detector.statistic(quiet), debounce).max())
        for quiet in (
            learning_hour(OWN_FEED_SEED + i, scenario.feed) for i in range(OWN_FEED_HOURS)
        )
    ]
    limit = MARGIN * max(peaks)
    return limit if limit > 0.0 else math.inf


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
