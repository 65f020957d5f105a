# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Isolation over time: what is named one minute to one day after the alarm."""

from collections.abc import Sequence

import numpy as np
from damadics_fd.core.scada.naming.isolation import group_of

from damadics_evaluate.benchmark.results import Result, plain
from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import Detector, Diagnosis
from damadics_evaluate.indices import decision_indices, diagnosis_accuracy, misisolation_rate
from damadics_evaluate.scenarios.cases import Case

AFTER_ALARM = (60.0, 600.0, 3600.0, 21600.0, 86400.0)  # s
LABELS = {60.0: '1 min', 600.0: '10 min', 3600.0: '1 h', 21600.0: '6 h', 86400.0: '24 h'}
END = 'end'
SETTLED_AFTER = 600.0  # s after the alarm, the diagnosis that is judged
SAME_LAW = (
    frozenset({6, 18}),  # flow is added
    frozenset({2, 3, 5, 19}),  # flow times a factor
    frozenset({9, 10}),  # air is lost from the chamber
    frozenset({4, 8}),  # play is wider
)
RIGHT, PAIR, WRONG = 'right', 'same law', 'wrong'


def verdict(named: int, fault: int) -> str:
    """
    Judge the fault named first.

    :param named: fault that is named first.
    :param fault: the true one.
    :return: RIGHT, PAIR where the two act by the same law on the signals, else WRONG.

    >>> verdict(18, 6), verdict(6, 6), verdict(1, 6)
    ('same law', 'right', 'wrong')
    """
    if named == fault:
        return RIGHT
    return PAIR if any({named, fault} <= law for law in SAME_LAW) else WRONG


def label_of(after: float) -> str:
    """Return how a time after the alarm is called."""
    return LABELS.get(after, END)


def isolation_result(
    detector: Detector, scenario: Case, alarm: float | None, samples: Floats, strength: Floats
) -> Result | None:
    """
    Follow the isolation after the alarm and return its indices.

    :param detector: fitted.
    :param scenario: with the true fault.
    :param alarm: when the alarm was raised, s; None for never.
    :param samples: rows of the run.
    :param strength: of the fault.
    :return: diagnoses over time, indices of PID and CID; None without an alarm or a diagnosis.
    """
    if alarm is None or not scenario.fault:
        return None
    t = samples[:, 0]
    times = [alarm + after for after in AFTER_ALARM if alarm + after < t[-1]]
    times.append(float(t[-1]))
    found = detector.isolate_at(samples, alarm, times)
    if not found:
        return None
    return _indices(found, scenario, alarm, t, strength)


def _indices(
    found: Sequence[Diagnosis], scenario: Case, alarm: float, t: Floats, strength: Floats
) -> Result:
    primary, complementary = np.zeros(len(t), bool), np.zeros(len(t), bool)
    for diagnosis in found:
        since = t >= diagnosis.t
        right = diagnosis.ranking[0][0] == scenario.fault
        primary[since], complementary[since] = right, not right
    dacc_tm, dacc = diagnosis_accuracy([d.candidates for d in found], scenario.fault)
    twins = decision_indices(t, primary, scenario.zones, strength).as_isolation()
    settled = [d for d in found if d.t <= alarm + SETTLED_AFTER] or found[:1]
    return {
        'diagnoses': [
            {
                't': d.t,
                'group': d.group,
                'candidates': list(d.candidates),
                'ranking': [
                    [fault, None if np.isnan(s) else round(s, 4), round(cost, 2)]
                    for fault, s, cost in d.ranking[:5]
                ],
            }
            for d in found
        ],
        'over_time': _over_time(found, scenario.fault, alarm),
        'right_group': settled[-1].group == group_of(scenario.fault),
        'right_first': settled[-1].ranking[0][0] == scenario.fault,
        'indices': plain(
            {
                **twins,
                'r_mi': misisolation_rate(t, complementary, scenario.zones),
                'dacc_tm': dacc_tm,
                'dacc': dacc,
            }
        ),
    }


def _over_time(found: Sequence[Diagnosis], fault: int, alarm: float) -> Result:
    """Return per time after the alarm the fault named first and whether that is right."""
    at = {}
    for d in found:
        first = d.ranking[0][0]
        after = next((a for a in AFTER_ALARM if abs(d.t - alarm - a) < 0.5), np.inf)
        at[label_of(after)] = {'named': first, 'verdict': verdict(first, fault)}
    last = found[-1].ranking[0][0]
    at[END] = {'named': last, 'verdict': verdict(last, fault)}
    return at
