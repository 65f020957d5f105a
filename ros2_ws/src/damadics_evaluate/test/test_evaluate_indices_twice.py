# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The indices of appendix II against a second implementation, written second by second."""

import math

import numpy as np
import pytest
from damadics_evaluate.indices import (
    Zones,
    decision_indices,
    diagnosis_accuracy,
    misisolation_rate,
)

GRID = 0.25  # s; all instants of the random signals lie on it


def walked(t, high, zones, strength):
    """Walk through time in steps of GRID with the signal held, count and remember edges."""
    value, previous, k = False, False, 0
    false_time = true_time = 0.0
    leading = falling = None
    for step in range(int(round(max(zones.t_hor, t[-1]) / GRID)) + 1):
        now = step * GRID
        while k < len(t) and t[k] <= now + 1e-9:
            previous, value = value, bool(high[k])
            if zones.t_from <= t[k] <= zones.t_hor and value != previous:
                if value:
                    leading = (t[k], strength[k])
                else:
                    falling = t[k]
            k += 1
        if k == 0 or not value:
            continue
        if zones.t_on <= now < zones.t_from:
            false_time += GRID
        if zones.t_from <= now < zones.t_hor:
            true_time += GRID
    seen = [v for a, v in zip(t, high, strict=True) if a <= zones.t_hor]
    nan = math.nan
    return {
        't_dt': leading[0] - zones.t_from if leading else nan,
        't_dm': leading[0] if leading else nan,
        't_drt': falling - zones.t_to if falling is not None and zones.t_to < 1e9 else nan,
        't_drm': falling if falling is not None else nan,
        'r_fd': false_time / (zones.t_from - zones.t_on),
        'r_td': true_time / (zones.t_hor - zones.t_from),
        'f_sd': leading[1] if leading else nan,
        'permanent': bool(seen and seen[-1]),
    }


def random_case(rng):
    t_on = GRID * rng.integers(4, 60)
    t_from = t_on + GRID * rng.integers(4, 120)
    t_hor = t_from + GRID * rng.integers(4, 200)
    t_to = t_from + GRID * rng.integers(1, 100) if rng.random() < 0.5 else math.inf
    zones = Zones(t_on, t_from, t_hor, t_to)
    length = int(t_hor / GRID) + rng.integers(-20, 40)
    share = rng.choice([1.0, 0.5, 0.1])
    ticks = np.flatnonzero(rng.random(length) < share)
    ticks = ticks if len(ticks) else np.array([0])
    stay = rng.choice([0.5, 0.9, 0.99])
    high = np.zeros(len(ticks), bool)
    high[0] = rng.random() < 0.3
    for i in range(1, len(ticks)):
        high[i] = high[i - 1] if rng.random() < stay else not high[i - 1]
    return zones, ticks * GRID, high, rng.normal(size=len(ticks))


@pytest.mark.parametrize('block', range(10))
def test_a_thousand_random_decision_signals(block):
    rng = np.random.default_rng([77, block])
    for case in range(100):
        zones, t, high, strength = random_case(rng)
        got = decision_indices(t, high, zones, strength)
        for name, wanted in walked(t, high, zones, strength).items():
            assert getattr(got, name) == pytest.approx(wanted, abs=1e-9, nan_ok=True), (
                f'{name} of case {case} in block {block}: {zones}'
            )
        twin = got.as_isolation()
        assert twin['t_it'] == pytest.approx(got.t_dt, nan_ok=True)
        wrong = sum(
            GRID
            for step in range(int(round(zones.t_hor / GRID)))
            if step * GRID >= zones.t_on and held(t, high, step * GRID)
        )
        rate = misisolation_rate(t, high, zones)
        assert rate == pytest.approx(wrong / (zones.t_hor - zones.t_on), abs=1e-9)


def held(t, high, now):
    before = [v for a, v in zip(t, high, strict=True) if a <= now + 1e-9]
    return bool(before and before[-1])


def test_random_diagnoses():
    rng = np.random.default_rng(78)
    for _ in range(300):
        fault = int(rng.integers(0, 5))
        named = [list(rng.integers(0, 5, rng.integers(0, 4))) for _ in range(rng.integers(1, 9))]
        total, last = 0.0, 0.0
        for each in named:
            faults = sorted({int(f) for f in each}) or [0]
            last = 1.0 / len(faults) if fault in faults else 0.0
            total += last
        assert diagnosis_accuracy(named, fault) == pytest.approx((total / len(named), last))
