# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every definition of appendix II on decision signals made by hand."""

import math

import numpy as np
import pytest
from damadics_evaluate.indices import (
    Zones,
    decision_indices,
    diagnosis_accuracy,
    high_time,
    misisolation_rate,
)

T = np.arange(0.0, 1501.0)
ZONES = Zones()


def high_in(*intervals):
    return np.any([(a <= T) & (b > T) for a, b in intervals], axis=0)


def test_latched_detection():
    strength = np.where(T >= 900, 0.25, 0.0)
    got = decision_indices(T, high_in((930, 9999)), ZONES, strength)
    assert (got.t_dt, got.t_dm, got.f_sd) == (30.0, 930.0, 0.25)
    assert got.r_fd == 0.0
    assert got.r_td == pytest.approx(570 / 600)
    assert got.permanent
    assert math.isnan(got.t_drt)


def test_the_last_leading_edge_counts():
    strength = np.clip((T - 900) / 600, 0, 1)
    got = decision_indices(T, high_in((905, 910), (1000, 1040), (1200, 9999)), ZONES, strength)
    assert got.t_dt == 300.0
    assert got.f_sd == pytest.approx(0.5)
    assert got.r_td == pytest.approx((5 + 40 + 300) / 600)


def test_false_time_counts_from_t_on_only():
    got = decision_indices(T, high_in((0, 330), (600, 660)), ZONES)
    assert got.r_fd == pytest.approx((30 + 60) / 600)
    assert math.isnan(got.t_dt)
    assert got.r_td == 0.0
    assert not got.permanent


def test_an_alarm_standing_since_before_the_fault_detects_nothing():
    got = decision_indices(T, high_in((500, 9999)), ZONES)
    assert math.isnan(got.t_dt)
    assert got.r_fd == pytest.approx(400 / 600)
    assert got.r_td == 1.0


def test_edges_after_the_horizon_do_not_count():
    t = np.arange(0.0, 3000.0)
    got = decision_indices(t, t >= 1600, ZONES)
    assert math.isnan(got.t_dt)
    assert got.r_td == 0.0
    assert not got.permanent


def test_detection_at_the_first_faulty_sample():
    assert decision_indices(T, high_in((900, 9999)), ZONES).t_dt == 0.0


def test_recovery():
    zones = Zones(t_to=1200.0)
    got = decision_indices(T, high_in((910, 1210)), zones)
    assert (got.t_drt, got.t_drm) == (10.0, 1210.0)


def test_picalc_differences():
    strength = np.where((T >= 950) & (T < 1300), 0.5, 0.0)
    decision = high_in((400, 410), (960, 1310))
    got = decision_indices(T, decision, ZONES, strength, picalc=True)
    assert got.t_dt == 10.0  # t_from is the first non-zero strength
    assert got.t_drt == 10.0  # t_to is its return to zero
    assert got.r_fd == pytest.approx((10 + 10) / (650 + 200))
    assert got.r_td == pytest.approx(340 / 550)


def test_picalc_writes_minus_one_and_needs_half_a_second():
    strength = np.where(T >= 900, 0.5, 0.0)
    silent = decision_indices(T, np.zeros_like(T), ZONES, strength, picalc=True)
    assert (silent.t_dt, silent.t_dm, silent.f_sd, silent.t_drt) == (-1.0, -1.0, -1.0, -1.0)
    at_once = decision_indices(T, high_in((900, 9999)), ZONES, strength, picalc=True)
    assert (at_once.t_dt, at_once.r_td) == (0.0, 0.0)
    assert decision_indices(T, high_in((900, 9999)), ZONES, strength).r_td == 1.0


def test_decision_threshold_of_half():
    assert math.isnan(decision_indices(T, np.full_like(T, 0.5), ZONES).t_dt)


def test_isolation_twins_carry_their_own_names():
    twin = decision_indices(T, high_in((1000, 9999)), ZONES).as_isolation()
    assert twin['t_it'] == 100.0
    assert set(twin) == {'t_it', 't_im', 't_irt', 't_irm', 'r_fi', 'r_ti', 'f_si', 'permanent'}


def test_misisolation_covers_set_up_to_horizon():
    rate = misisolation_rate(T, high_in((0, 360), (1000, 1060)), ZONES)
    assert rate == pytest.approx(120 / 1200)


def test_uneven_sampling_weights_by_time():
    assert high_time([0.0, 10.0, 11.0], [1, 0, 1], 5.0, 20.0) == pytest.approx(5 + 9)


def test_diagnosis_accuracy():
    assert diagnosis_accuracy([[], [], [4, 11], [4]], 4) == (pytest.approx(1.5 / 4), 1.0)
    assert diagnosis_accuracy([[], [0]], 0) == (1.0, 1.0)
    assert diagnosis_accuracy([[4], [9]], 4) == (0.5, 0.0)


@pytest.mark.parametrize('bad', [([0, 1], [1]), ([1, 0], [1, 1]), ([], [])])
def test_bad_signals_are_refused(bad):
    with pytest.raises(ValueError):
        decision_indices(*bad, ZONES)


def test_zones_must_ascend():
    with pytest.raises(ValueError, match='ascending'):
        Zones(t_on=900.0, t_from=300.0)
    assert Zones.of_development(86400.0).t_hor == 87900.0
