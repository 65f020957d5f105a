# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The 19 faults: catalogue, time course, and what each does to the plant (table 2.1)."""

import numpy as np
import pytest
from damadics_plant import CATALOGUE, Fault, Scenario, simulate
from damadics_plant.scenarios.sources import Constant, Steps

STILL = 60  # s, long enough for the valve to come to rest


def settled(*faults, cv=0.5, **inputs):
    """Return the run of a valve that has come to rest, with faults from the start."""
    return simulate(Scenario('test', STILL, cv=Constant(cv), faults=faults, **inputs), rate=1)


@pytest.fixture(scope='module')
def healthy():
    return settled()


def test_catalogue_is_complete():
    assert [kind.number for kind in CATALOGUE.values()] == list(range(1, 20))
    assert all(kind.meaning and kind.injection for kind in CATALOGUE.values())


@pytest.mark.parametrize(
    ('t', 'strength'),
    [
        (69.99, 0),
        (70, 0),
        (75, 0.2),
        (80, 0.4),
        (90, 0.8),
        (99.9, 0.8),
        (100, 0),
    ],
)
def test_incipient_fault_follows_its_time_course(t, strength):
    assert Fault('f4', 0.8, start=70, development=20, end=100).at(t) == pytest.approx(strength)


def test_abrupt_fault_acts_from_its_first_instant():
    assert Fault('f11', 0.5, start=70).at(70) == 0.5
    assert Fault('f12', 0.5, start=70, direction=-1).at(70) == -0.5


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'fault': 'f20'}, 'f1..f19'),
        ({'fault': 'f1', 'strength': -0.5}, r'0..1'),
        ({'fault': 'f4', 'strength': 1.5}, r'-1..1'),
        ({'fault': 'f4', 'direction': 2}, 'direction'),
        ({'fault': 'f4', 'start': -1}, 'from'),
        ({'fault': 'f4', 'start': 5, 'end': 5}, 'to'),
        ({'fault': 'f4', 'development': float('nan')}, 'development'),
    ],
)
def test_bad_fault_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Fault(**arguments)


def test_spring_may_stiffen_on_the_lugre_plant_only():
    stiff = Scenario('test', 1, faults=(Fault('f11', -0.5),))
    assert simulate(stiff, model='lugre').strength[-1] == -0.5
    with pytest.raises(ValueError, match='dablib'):
        simulate(stiff)


def test_f1_and_f2_limit_the_travel():
    assert settled(Fault('f1', 0.4), cv=1).x1[-1] == pytest.approx(0.6)
    assert settled(Fault('f2', 0.5), cv=1).x1[-1] == pytest.approx(0.9)


def test_f3_lets_more_through():
    eroded, healthy = settled(Fault('f3', 1), cv=0.8), settled(cv=0.8)
    assert eroded.flow[-1] / healthy.flow[-1] == pytest.approx(1.1 * np.exp(0.5), rel=0.01)


def test_f4_holds_the_stem_back():
    cv = Steps((0, 30), (0.5, 0.4))
    runs = [
        simulate(Scenario('test', STILL, cv=cv, faults=faults), rate=1)
        for faults in ((), (Fault('f4', 0.5, start=29),))
    ]
    assert runs[1].x1[32] - runs[0].x1[32] > 0.05


def test_f5_f6_change_the_flow_only(healthy):
    leaking = settled(Fault('f5', 1))
    assert np.array_equal(leaking.x1, healthy.x1)
    assert leaking.flow[-1] == pytest.approx(0.95 * healthy.flow[-1])
    closed = settled(Fault('f6', 0.1), cv=1.0)
    assert closed.flow[-1] > 10 * settled(cv=1.0).flow[-1]


def test_f7_heats_the_medium(healthy):
    run = settled(Fault('f7', 0.5))
    assert run.t1[-1] == 200  # the transmitter is at its limit
    assert abs(run.x1 - healthy.x1).max() > 0.1


def test_f9_f10_cost_air(healthy):
    assert settled(Fault('f9', 1)).x1[3] <= healthy.x1[3]
    assert settled(Fault('f10', 0.9)).x1[-1] == 0  # too little force to close


def test_f11_weakens_the_spring(healthy):
    assert settled(Fault('f11', 0.5)).ps[-1] < healthy.ps[-1] - 20e3


def test_f12_scales_the_booster():
    slow, fast = (settled(Fault('f12', f), cv=1).x1[5] for f in (0.9, -0.9))
    assert slow < fast


def test_f13_scales_position_and_feedback():
    run = settled(Fault('f13', 0.4))
    assert run.x1[-1] == pytest.approx(0.5, abs=0.02)  # the positioner believes its sensor
    assert run.flow[-1] > settled(cv=0.5).flow[-1]


def test_f14_scales_the_reading_only(healthy):
    run = settled(Fault('f14', -0.5))
    assert np.array_equal(run.x1, healthy.x1)
    assert np.allclose(run.ps, 1.5 * healthy.ps)


def test_f15_makes_the_loop_swing():
    cv = Steps((0, 30), (0.7, 0.4))
    run = simulate(Scenario('test', 90, cv=cv, faults=(Fault('f15', 0.75),)), rate=1)
    assert abs(run.x1[-1] - 0.4) > 0.2


def test_f16_weakens_the_supply():
    assert settled(Fault('f16', 0.9)).x1[-1] == 0  # 60 kPa count as none
    assert settled(Fault('f16', 0.75), cv=1).ps[-1] < 151e3


def test_f17_changes_the_pressures(healthy):
    low_outlet, low_inlet = (settled(Fault('f17', f)) for f in (0.5, -0.2))
    assert low_outlet.p2[-1] == 1.3e6
    assert low_inlet.p1[-1] == pytest.approx(2.8e6)
    assert low_outlet.flow[-1] > healthy.flow[-1] > low_inlet.flow[-1]


def test_f18_adds_flow_f19_scales_it(healthy):
    bypass = settled(Fault('f18', 0.5), cv=0.9)
    plain = settled(cv=0.9)
    added = 19.75 * 0.5 * 100 * np.sqrt(0.9 / 1000) / 3.6
    assert bypass.flow[-1] - plain.flow[-1] == pytest.approx(added, rel=0.01)
    assert settled(Fault('f19', 0.25)).flow[-1] == pytest.approx(0.75 * healthy.flow[-1])


def test_several_faults_act_together_with_a_warning():
    faults = (Fault('f5', 1), Fault('f19', 0.5))
    with pytest.warns(UserWarning, match='one fault at a time'):
        run = settled(*faults)
    assert run.flow[-1] == pytest.approx(settled().flow[-1] * 0.95 * 0.5)
    assert run.fault[-1] == 5
