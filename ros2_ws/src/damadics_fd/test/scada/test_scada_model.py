# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Reduced model and valve equation against facts of the benchmark."""

import numpy as np
import pytest
from damadics_fd.core.scada.laws.actuator import nominal_flow, valve_flow
from damadics_fd.core.scada.model import FAULTS, STEM, advance_stem, advance_two, start_stem
from damadics_fd.core.valve.flow import density
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.plug import RECOVERY, recovery
from damadics_fd.core.valve.pneumatics import ATMOSPHERE, characteristic

ACT = Valve().record()
P1, P2 = 3.5e6, 2.6e6
DROP = (P1 - P2) / 4e6


def follow(cv, seconds, faults=None, drop=DROP):
    """Return stem state and position after holding CV from rest."""
    stem = np.zeros(1, STEM)
    fault = np.zeros(1, FAULTS)
    for name, value in (faults or {}).items():
        fault[name] = value
    start_stem(stem[0], ACT[0], 0.0)
    x = [
        advance_stem(stem[0], ACT[0], fault[0], k - 1.0, k, cv, cv, drop, drop, 0.0, 0.0)
        for k in range(1, seconds + 1)
    ]
    return stem[0], np.array(x)


def test_step_response_times_of_the_benchmark():
    _, x = follow(1.0, 20)
    assert x[1] < 0.001  # dead time 2.9 s
    assert x[2] > 0.005
    assert x[11] > 0.99  # 99 % at 11.6 s
    stem, x = follow(0.5, 60)
    assert x[-1] == pytest.approx(0.5, abs=0.02)
    assert stem.p - 101325.0 == pytest.approx(143e3, rel=0.03)


def test_flow_at_half_stroke_and_at_the_stops():
    act = ACT[0]
    flow = valve_flow(act, 0.5, P1, P2, 43.0, 0.0, 1.0, 0.0, 0.0)
    assert flow == pytest.approx(29.5, rel=0.01)
    assert valve_flow(act, 1.0, P1, P2, 43.0, 0.0, 1.0, 0.0, 0.0) == 0.0
    assert nominal_flow(act, 0.0, P1 / 4e6, P2 / 4e6, 43.0 / 200.0) == 1.0  # saturated
    assert valve_flow(act, 0.5, P2, P1, 43.0, 0.0, 1.0, 0.0, 0.0) < 0.0


def test_flow_faults():
    act = ACT[0]
    nominal = valve_flow(act, 0.6, P1, P2, 43.0, 0.0, 1.0, 0.0, 0.0)
    assert valve_flow(act, 0.6, P1, P2, 43.0, 0.1, 0.9, 0.0, 0.0) == pytest.approx(
        nominal * 0.9 * np.exp(-0.5)
    )
    bypass = valve_flow(act, 0.6, P1, P2, 43.0, 0.0, 1.0, 0.0, 0.25) - nominal
    assert bypass == pytest.approx(19.75 * 0.25 * 100 * np.sqrt(0.9 / 1000.0))


def test_choked_flow_does_not_grow_with_pressure_drop():
    act = ACT[0]
    hot = [valve_flow(act, 0.3, P1, p2, 243.0, 0.0, 1.0, 0.0, 0.0) for p2 in (2.0e6, 1.0e6)]
    assert hot[0] == pytest.approx(hot[1])


def test_water_density():
    assert density(20.0, 1e5) == pytest.approx(998.2, abs=0.5)
    assert density(100.0, 1e5) == pytest.approx(958.4, abs=1.0)


def test_pressure_recovery_table():
    table = [(-0.1, 1), (0, 1), (0.1, 0.95), (0.45, 0.755), (0.9, 0.5), (0.99, 0.45), (1.2, 0.4)]
    for x, value in table:
        assert recovery(np.array(RECOVERY), x) == pytest.approx(value)


def test_transducer_corners():
    for cvi, e in ((-1, -0.55), (-0.94, -0.55), (-0.54, -0.02), (0.46, 0.02), (0.86, 1), (1, 1)):
        assert characteristic(cvi) == pytest.approx(e)


def test_faults_move_the_stem_as_the_benchmark_says():
    _, nominal = follow(1.0, 60)
    assert follow(1.0, 60, {'f1': 0.25})[1][-1] == pytest.approx(0.75)
    assert follow(0.5, 60, {'f13': 0.25})[1][-1] == pytest.approx(0.5, abs=0.02)
    assert follow(1.0, 60, {'f16': 0.9})[1][-1] == 0.0  # below 120 kPa the supply is gone
    assert follow(1.0, 10, {'f12': 0.5})[1][-1] < nominal[9] - 0.1
    assert follow(0.5, 3, {'f11': 0.75})[1][-1] > follow(0.5, 3)[1][-1] + 0.1


def test_state_does_not_depend_on_how_the_time_is_cut():
    whole, _ = follow(0.6, 30)
    stem = np.zeros(1, STEM)
    start_stem(stem[0], ACT[0], 0.0)
    for k in range(300):
        advance_stem(
            stem[0],
            ACT[0],
            np.zeros(1, FAULTS)[0],
            k / 10,
            (k + 1) / 10,
            0.6,
            0.6,
            DROP,
            DROP,
            0.0,
            0.0,
        )
    assert pytest.approx(whole.X, abs=1e-12) == stem[0].X


def test_without_play_the_air_in_the_chamber_is_conserved_through_any_motion():
    act = Valve(stem_play=0.0).record()
    stem, nominal = np.zeros(1, STEM), np.zeros(1, FAULTS)
    start_stem(stem[0], act[0], 0.0)
    cv = 0.5 + 0.25 * np.sin(np.arange(0.0, 4000.0) * 0.3)
    for k in range(1, len(cv)):
        advance_stem(
            stem[0], act[0], nominal[0], k - 1.0, k, cv[k - 1], cv[k], DROP, DROP, 0.0, 0.0
        )
    volume = act[0].open_volume + act[0].area * stem[0].X
    at_rest = ATMOSPHERE * act[0].chamber_volume / start_mass(act)
    assert stem[0].p * volume / stem[0].m_a == pytest.approx(at_rest, rel=1e-4)


def start_mass(act):
    """Return the air in the chamber of a valve at rest."""
    stem = np.zeros(1, STEM)
    start_stem(stem[0], act[0], 0.0)
    return stem[0].m_a


def test_two_stems_side_by_side_move_as_each_does_alone():
    rng = np.random.default_rng(3)
    fault = np.zeros(2, FAULTS)
    for name in FAULTS.names:
        fault[0] = np.zeros(1, FAULTS)[0]
        fault[0][name] = rng.uniform(0.05, 1.0)
        alone, beside = np.zeros(2, STEM), np.zeros(2, STEM)
        for stem in (*alone, *beside):
            start_stem(stem, ACT[0], 0.0)
        cv = np.repeat(rng.uniform(0.0, 1.0, 5), 4)
        for k in range(1, len(cv)):
            drop = DROP + 0.02 * rng.standard_normal(2)
            inputs = (k - 1.0, float(k), cv[k - 1], cv[k], *drop, 0.01, -0.01)
            one = [advance_stem(alone[i], ACT[0], fault[i], *inputs) for i in range(2)]
            two = advance_two(beside[0], beside[1], ACT[0], fault[0], fault[1], *inputs)
            assert tuple(one) == two
        assert alone.tobytes() == beside.tobytes(), name
