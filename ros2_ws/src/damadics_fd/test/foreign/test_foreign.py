# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Valves that are not the model inside: what commission finds of them, and what is monitored."""

from dataclasses import replace

import numpy as np
import pytest
from damadics_fd.commands.commission import verdict
from damadics_fd.commands.commission.forces.balance import find_balance
from damadics_fd.commands.commission.forces.breakaway import breakaway
from damadics_fd.commands.commission.monitor import identify
from damadics_fd.commands.commission.signals import blocks, gather
from damadics_fd.commands.commission.twin.constants import twin
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.identified import FaultFree
from damadics_plant import Fault, Scenario, simulate
from damadics_plant.actuator.parameters import LuGreActuator
from damadics_plant.actuator.twin import twin_of
from damadics_plant.scenarios.sources import RandomSteps, Recorded, Sine

from . import courses, kinds
from . import valve as foreign
from .trial import commissioned, trial


def balance(build, seed, minutes=10.0, spoil=None):
    columns = foreign.simulate(build, courses.steps(60.0 * minutes, seed), seed=seed)
    if spoil:
        columns = spoil(columns)
    sheet = Settings.for_mode('monitor', **foreign.sheet(build))
    return find_balance(gather([FaultFree('strokes', columns)]), sheet)


@pytest.mark.parametrize('air', ['close', 'open'])
@pytest.mark.parametrize('flow', ['open', 'close'])
def test_action_and_direction_of_flow_are_found(air, flow):
    low = {'p1': 1.2e6, 'p2': 0.9e6} if air == flow else {}  # more could not be moved
    build = kinds.random_valve(21, air_to=air, flow_to=flow, **low)
    b = balance(build, 21)
    assert (b.settings.air_to, b.settings.flow_to) == (air, flow)
    assert b.undetermined == ()
    assert b.settings.stiffness == pytest.approx(build.stiffness, rel=0.03)
    assert b.settings.preload == pytest.approx(build.preload, abs=0.03)
    assert b.friction == pytest.approx(build.dry * build.force, rel=0.25)


@pytest.mark.parametrize('lag', [0.05, 0.1, 0.2])
def test_the_lag_of_the_pressure_is_found(lag):
    build = kinds.random_valve(22, ps_lag=lag)
    b = balance(build, 22)
    assert b.settings.ps_lag == pytest.approx(lag, abs=0.015)
    assert b.settings.stiffness == pytest.approx(build.stiffness, rel=0.03)


@pytest.mark.parametrize(('seed', 'lag'), [(601, 0.0), (601, 0.05), (8541, 0.05), (8848, 0.0)])
def test_the_lag_is_found_where_the_stem_sticks_and_slips(seed, lag):
    build = kinds.random_valve(seed, ps_lag=lag)  # its strokes are stairs
    b = balance(build, seed, minutes=20.0)
    assert np.mean(b.sticky) > 0.5
    assert b.settings.ps_lag == pytest.approx(lag, abs=0.02)
    assert b.friction == pytest.approx(build.dry * build.force, rel=0.15)


def test_the_mass_of_the_stem_is_not_taken_for_a_lag():
    build = kinds.random_valve(22, mass=15.0)  # does what a lag of 22 ms would
    b = balance(build, 22)
    assert b.settings.ps_lag == 0.0
    assert b.friction == pytest.approx(build.dry * build.force, rel=0.05)


@pytest.mark.parametrize('wrong', [{'plug_gain': 1.2}, {'plug_shape': 0.1}, {'plug_gain': 0.15}])
def test_the_plug_force_is_found(wrong):
    build = kinds.random_valve(23, **wrong)
    s = balance(build, 23).settings
    shape = 1 + build.plug_shape * np.sin(2 * np.pi * foreign.NODES + 0.7)
    true = foreign.SHEET_KM / (build.plug_gain * shape)
    found = np.array(s.plug_table) * (build.plug_diameter / s.plug_diameter) ** 2
    assert found[:10] == pytest.approx(true[:10], rel=0.05)


@pytest.mark.parametrize('noise', [0.0, 1.4e-3])  # of the position, on top
def test_noise_of_steady_pressures_does_not_hide_the_plug_force(noise):
    """Where P1 - P2 is steady, the correction that takes its noise out is no plug force at all."""
    scenario = Scenario('strokes', 600.0, cv=RandomSteps(seed=8225))
    columns = dict(simulate(scenario, rate=200.0, model='lugre', seed=8225))
    rng = np.random.default_rng(8225)
    for name in ('p1', 'p2'):
        columns[name] = columns[name] + 5e3 * rng.standard_normal(len(columns['x1']))
    columns['x1'] = columns['x1'] + noise * rng.standard_normal(len(columns['x1']))
    columns['stamp'] = (np.arange(len(columns['x1'])) * 5_000_000).astype(np.int64)
    b = find_balance(gather([FaultFree('strokes', columns)]), Settings.for_mode('monitor'))
    assert b.settings.flow_to == 'open'
    assert b.settings.ps_lag == 0.0
    assert b.gain == pytest.approx(1.0, abs=0.1)
    assert b.settings.stiffness == pytest.approx(LuGreActuator().stiffness, rel=0.2)
    assert b.friction == pytest.approx(LuGreActuator().coulomb, rel=0.15)
    assert any('P1 - P2 did not vary' in name for name in b.undetermined)


@pytest.mark.parametrize('seed', [8300, 8302])
def test_noise_of_the_position_is_not_taken_for_a_lag(seed):
    """A lag smooths it: what that saves of the misfit, with the plug's steep force, is no lag."""
    scenario = Scenario('strokes', 600.0, cv=RandomSteps(seed=seed))
    columns = dict(simulate(scenario, rate=200.0, model='lugre', seed=seed))
    rng = np.random.default_rng(seed)
    columns['x1'] = columns['x1'] + 1.4e-3 * rng.standard_normal(len(columns['x1']))
    columns['stamp'] = (np.arange(len(columns['x1'])) * 5_000_000).astype(np.int64)
    b = find_balance(gather([FaultFree('strokes', columns)]), Settings.for_mode('monitor'))
    assert b.settings.ps_lag == 0.0
    assert b.friction == pytest.approx(LuGreActuator().coulomb, rel=0.1)


def test_five_percent_of_missing_or_doubled_samples_do_not_matter():
    rng = np.random.default_rng(5)

    def spoil(columns):
        columns['ps'][rng.random(len(columns['ps'])) < 0.05] = np.nan
        late = np.flatnonzero(rng.random(len(columns['ps'])) < 0.05)[1:]
        columns['stamp'][late] = columns['stamp'][late - 1]
        return columns

    build = kinds.random_valve(24)
    b = balance(build, 24, spoil=spoil)
    assert b.settings.stiffness == pytest.approx(build.stiffness, rel=0.03)


@pytest.mark.parametrize(
    ('seed', 'later', 'change'),
    [
        (25, 25, {'plug_shape': 0.1}),
        (25, 25, {'air_to': 'open', 'flow_to': 'close'}),
        (8903, 12903, {'ps_lag': 0.2}),  # it carries the friction of rest into every stroke
    ],
    ids=['wrong plug shape', 'air and flow the other way', 'lag'],
)
def test_a_foreign_valve_is_watched_without_alarm_and_its_fault_named(seed, later, change):
    build = kinds.random_valve(seed, **change)
    proposal = commissioned(build, seed)
    assert proposal.verdict == 'ok', proposal.limiting
    for fault in ('friction +100 %', 'spring -20 %'):
        t = trial(build, proposal, fault, later)
        assert t.armed
        assert t.false_alarms == 0
        assert t.found
        assert t.delay < 60.0
        assert t.right, t.cause
        assert np.isnan(t.size) or t.size == pytest.approx(t.true, rel=0.15)


def test_a_balanced_trim_is_not_taken_for_noise():
    build = kinds.random_valve(702, plug_gain=0.15)
    proposal = commissioned(build, 702, minutes=10.0)
    assert proposal.settings.rho_min < 2.0
    assert proposal.result.estimator.monitoring


def test_a_plug_that_the_flow_slams_shut_raises_no_alarm():
    build = kinds.random_valve(104, air_to='open', flow_to='close')
    proposal = commissioned(build, 104)
    t = trial(build, proposal, 'friction +100 %', 104, quiet=1900.0)
    assert (t.false_alarms, t.right) == (0, True)


@pytest.mark.parametrize(('seed', 'sticks'), [(402, True), (25, False)])
def test_a_stem_that_sticks_and_slips_is_told(seed, sticks):
    proposal = commissioned(kinds.random_valve(seed), seed, minutes=10.0)
    assert any('sticks and slips' in remark for remark in proposal.remarks) is sticks


@pytest.mark.parametrize('lag', [0.0, 0.1])
def test_sticking_and_slipping_is_not_taken_for_friction(lag):
    build = kinds.random_valve(140, ps_lag=lag)
    proposal = commissioned(build, 140)
    b = proposal.balance
    assert b.settings.stiffness == pytest.approx(build.stiffness, rel=0.01)
    assert b.friction == pytest.approx(build.dry * build.force, rel=0.05)
    t = trial(build, proposal, 'friction +100 %', 140, quiet=600.0)
    assert (t.false_alarms, t.right) == (0, True)
    assert t.size == pytest.approx(1.0, rel=0.15)


def test_stated_deviations_cover_the_truth():
    missed = []
    for seed in range(140, 146):
        build = kinds.random_valve(seed)
        proposal = commissioned(build, seed)
        for fault in ('friction +100 %', 'dry +300 %', 'spring -20 %'):
            t = trial(build, proposal, fault, seed, quiet=600.0)
            if not np.isnan(t.size) and not abs(t.size - t.true) <= 2.0 * t.std:
                missed.append((seed, fault, t.size, t.std))
    assert len(missed) <= 2, missed


def test_a_plug_or_an_area_that_is_not_the_sheets_is_told():
    build = kinds.random_valve(31)
    b = balance(build, 31, minutes=5.0)
    sheet = Settings.for_mode('monitor', **foreign.sheet(build))
    stated = {'stroke', 'area', 'stiffness', 'plug_diameter'}
    for share, told in ((1.0, False), (1.2, False), (0.8, False), (1.3, True), (0.7, True)):
        found = verdict.another_plug(replace(b, gain=share, plug=share * b.plug), sheet, stated)
        assert bool(found) is told, (share, found)
    balanced = replace(b, gain=0.15, plug=0.15 * b.plug)
    assert verdict.another_plug(balanced, sheet, stated) == []
    for found, names in ((b, 'stroke'), (balanced, 'stroke, area')):
        told = verdict.unchecked(found, sheet, {'stroke', 'area'})
        assert told[0].startswith(f'the data sheet alone tells {names}:')


@pytest.mark.parametrize('wrong', ['stroke', 'stiffness', 'area', 'everything'])
def test_constants_of_another_valve_never_arm(wrong):
    build = kinds.CATALOGUE['G100' if wrong == 'everything' else 'G38']
    columns = foreign.simulate(build, courses.steps(400.0, 31), seed=31)
    right = {'stroke': 0.0381, 'stiffness': 61e3, 'area': 0.029, 'alpha4': 20333.0}
    given = {} if wrong == 'everything' else {wrong: 1.6 * right[wrong]}
    result = run(columns, Settings.for_mode('monitor', **given))
    assert not result.estimator.monitoring
    assert 'not those of this valve' in result.estimator.status
    assert 'run commission' in result.estimator.status


def test_a_standing_fault_is_one_occurrence():
    build = kinds.random_valve(26)
    proposal = commissioned(build, 26)
    for fault in ('friction +300 %', 'spring -20 %'):
        t = trial(build, proposal, fault, 26, quiet=300.0, after=1500.0)
        assert (t.false_alarms, t.occurrences) == (0, 1)
    loop = courses.control(1800.0, 26)
    t = trial(build, proposal, 'friction +300 %', 26, quiet=300.0, after=1500.0, cv=loop)
    assert t.occurrences <= 1


@pytest.mark.parametrize('seed', [923, 925, 965])
def test_static_friction_is_found_however_fast_the_stem_is_pulled(seed):
    build = kinds.random_valve(seed)
    b = balance(build, seed, minutes=5.0)
    columns = foreign.simulate(build, courses.steps(300.0, seed), seed=seed)
    found = breakaway(gather([FaultFree('strokes', columns)]), b.settings, b.friction)
    assert found.force == pytest.approx(build.static * build.dry * build.force, rel=0.08)


def test_static_friction_is_found_beneath_the_noise_of_the_benchmark():
    """A stem is seen to have left its place when its spring has given by half the friction."""
    swing = Sine(3.5e6, 7e4, 0.1)
    scenario = Scenario('strokes', 600.0, cv=RandomSteps(seed=8221), p1=swing)
    columns = dict(simulate(scenario, rate=200.0, model='lugre', noise=True, seed=8221))
    columns['stamp'] = (np.arange(len(columns['x1'])) * 5_000_000).astype(np.int64)
    signals = gather([FaultFree('strokes', columns)])
    b = find_balance(signals, Settings.for_mode('monitor'))
    found = breakaway(signals, b.settings, b.friction)
    assert found.force == pytest.approx(LuGreActuator().static, rel=0.1)


@pytest.mark.parametrize('lag', [0.1, 0.2])
def test_a_lag_of_the_pressure_is_no_hysteresis_of_the_diaphragm(lag):
    build = kinds.random_valve(7501, ps_lag=lag)
    proposal = commissioned(build, 7501)
    assert proposal.settings.hysteresis < 0.1 * build.dry * build.force
    t = trial(build, proposal, 'friction +100 %', 7501, quiet=300.0)
    assert t.size == pytest.approx(1.0, rel=0.15)
    assert abs(t.size - t.true) < 2.0 * t.std


@pytest.mark.parametrize('noise', [1e-4, 5e-4])
def test_bristles_that_give_before_a_stem_breaks_away_are_no_hysteresis(noise):
    def strokes(seconds, seed, *faults):
        scenario = Scenario('strokes', seconds, cv=RandomSteps(seed=seed), faults=faults)
        columns = dict(simulate(scenario, rate=200.0, model='lugre', seed=seed))
        rng = np.random.default_rng(seed)
        columns['x1'] = columns['x1'] + noise * rng.standard_normal(len(columns['x1']))
        columns['ps'] = columns['ps'] + 100.0 * rng.standard_normal(len(columns['x1']))
        columns['stamp'] = (np.arange(len(columns['x1'])) * 5_000_000).astype(np.int64)
        return columns

    learned = [FaultFree('strokes', strokes(600.0, 8208))]
    settings = identify(learned, Settings.for_mode('monitor')).settings
    assert settings.hysteresis == 0.0
    doubled = strokes(600.0, 8209, Fault('f4', 0.05, 300.0))
    view = run(doubled, settings).detector.signature.view()
    assert view.cause == 'friction_up'
    assert view.value == pytest.approx(1.0, rel=0.15)


def test_hysteresis_of_the_diaphragm_is_no_friction():
    sound, build = kinds.random_valve(3311), kinds.random_valve(3311, hysteresis=0.02)
    assert commissioned(sound, 3311, minutes=10.0).settings.hysteresis == 0.0
    proposal = commissioned(build, 3311, minutes=10.0)
    assert proposal.settings.hysteresis == pytest.approx(0.02 * build.force, rel=0.3)
    for fault in ('friction +100 %', 'dry +300 %'):
        t = trial(build, proposal, fault, 3311, quiet=300.0)
        assert t.right
        assert abs(t.size - t.true) < 2.0 * t.std
        assert t.size == pytest.approx(t.true, rel=0.15)


@pytest.mark.parametrize(
    ('seed', 'other'), [(27, {}), (28, {'air_to': 'open', 'flow_to': 'close'})]
)
def test_a_twin_moves_as_the_valve_did(seed, other):
    low = {'p1': 1.2e6, 'p2': 0.9e6} if other else {}
    build = kinds.random_valve(seed, **other, **low)
    columns = foreign.simulate(build, courses.steps(600.0, seed), seed=seed)
    half = len(columns['x1']) // 2
    sheet = foreign.sheet(build)
    first = [FaultFree('first half', {name: c[:half] for name, c in columns.items()})]
    constants = twin(identify(first, Settings.for_mode('monitor', **sheet), sheet))
    assert constants['stiffness'] == pytest.approx(build.stiffness, rel=0.03)
    assert constants['static'] >= constants['coulomb'] > 0.0
    t = np.arange(2 * half) * 0.005
    scenario = Scenario(
        'as recorded',
        3.0 * half * 0.005,
        **{name: Recorded(t, columns[name]) for name in ('cv', 'p1', 'p2')},
    )
    again = simulate(scenario, rate=200.0, model=twin_of(constants, 'here'))['x1'][: 2 * half]
    error = (np.asarray(again) - columns['x1'])[half:]
    assert np.sqrt(np.mean(error**2)) < 0.015


def test_a_twin_sticks_and_slips_where_the_valve_does():
    """Slides it instead, faults are foretold sooner than they are found."""
    build = kinds.random_valve(8501)
    cv = courses.steps(900.0, 8501)
    columns = foreign.simulate(build, cv, seed=8501)
    sheet = foreign.sheet(build)
    learned = [FaultFree('strokes', {name: c[:120_000] for name, c in columns.items()})]
    model = twin_of(twin(identify(learned, Settings.for_mode('monitor', **sheet), sheet)), 'here')
    p1, p2 = Sine(build.p1, 0.02 * build.p1, 0.1), Sine(build.p2, 0.01 * build.p2, 0.3)
    scenario = Scenario(
        'as commanded', 900.0, cv=Recorded(np.arange(len(cv)) * 0.005, cv), p1=p1, p2=p2
    )
    again = {name: c[: len(cv)] for name, c in dict(simulate(scenario, 200.0, model)).items()}
    noise = build.noise_x * np.random.default_rng(1).standard_normal(len(cv))
    again = again | {'x1': again['x1'] + noise, 'stamp': columns['stamp']}

    def sticking(recorded):
        last = {name: np.asarray(c)[120_000:] for name, c in recorded.items()}
        b = blocks(gather([FaultFree('last', last)]), 0.1)
        return float(np.mean(b.sticky[b.moving]))

    assert sticking(again) > 0.75 * sticking(columns) > 0.5
