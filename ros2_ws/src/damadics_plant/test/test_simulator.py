# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Runs: contract of the columns, blocks, seeds, inputs by hand, what holds for any input."""

import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from damadics_plant import CATALOGUE, Fault, Scenario, Simulator, simulate
from damadics_plant.actuator.parameters import RANGES
from damadics_plant.batch import simulate_many
from damadics_plant.scenarios.level import LevelLoop
from damadics_plant.scenarios.sources import Constant, RandomSteps, Steps
from hypothesis import given, settings
from hypothesis import strategies as st

MODELS = ('dablib', 'lugre')


def test_columns_of_a_run():
    run = simulate('paper_friction')
    assert list(run) == ['stamp', 'cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps', 'fault', 'strength']
    assert {name: column.dtype.name for name, column in run.items()} == {
        name: 'int64' if name in ('stamp', 'fault') else 'float64' for name in run
    }
    assert run.stamp.shape == (48001,)
    assert run.stamp[1] == 2_500_000
    assert run.stamp[-1] == 120 * 10**9
    assert run.t[12316] == 30.79
    with pytest.raises(AttributeError, match='strength'):
        _ = run.speed
    assert np.array_equal(pickle.loads(pickle.dumps(run)).x1, run.x1)


def test_stamps_are_exact_where_the_period_is_not():
    run = simulate('paper_nominal', rate=300, model='lugre', duration=10)
    assert run.stamp[:4].tolist() == [0, 3333333, 6666667, 10_000_000]
    assert run.stamp[-1] == 10 * 10**9


@pytest.mark.parametrize('model', MODELS)
@pytest.mark.parametrize('cv', [RandomSteps(), LevelLoop(period=0.7)], ids=['random', 'loop'])
def test_blocks_do_not_change_the_run(model, cv):
    scenario = Scenario('test', 60, cv=cv, faults=(Fault('f4', 1, start=20, development=20),))
    whole = simulate(scenario, model=model, noise=True, seed=7)
    simulator = Simulator(scenario, model=model, noise=True, seed=7)
    sizes = iter([1, 2, 3, 777, 5000] + 100 * [1234])
    parts = []
    while not simulator.finished:
        parts.append(simulator.advance(next(sizes)))
    for name in whole:
        assert np.array_equal(np.concatenate([part[name] for part in parts]), whole[name]), name
    assert len(simulator.advance(10)['x1']) == 0


@pytest.mark.parametrize('model', MODELS)
def test_slow_recorder_sees_the_same_run(model):
    fast = simulate('random_friction', model=model, noise=True, seed=3)
    slow = simulate('random_friction', rate=1, model=model, noise=True, seed=3)
    view = fast.view(1)
    for name in slow:
        assert np.array_equal(view[name], slow[name]), name
    with pytest.raises(ValueError, match='divide'):
        fast.view(7)


def test_seed_decides_the_noise():
    runs = [simulate('paper_nominal', noise=True, seed=seed, duration=20) for seed in (1, 1, 2)]
    assert np.array_equal(runs[0].x1, runs[1].x1)
    assert not np.array_equal(runs[0].x1, runs[2].x1)


def test_two_random_inputs_differ():
    run = simulate(Scenario('test', 60, cv=RandomSteps(), t1=RandomSteps()), rate=1)
    assert not np.array_equal(run.cv, run.t1)


@pytest.mark.parametrize(
    ('model', 'values'),
    [
        (
            'dablib',
            [0.04875771072716806, 0.23100571226817979, 3489386.3531229743, 162129.902315901],
        ),
        (
            'lugre',
            [0.04875771072716806, 0.2486307297231431, 3495982.5781912585, 173515.0544567246],
        ),
    ],
)
def test_seed_means_the_same_on_every_python(model, values):
    run = simulate('random_friction', rate=1, model=model, noise=True, seed=5)
    assert [run.cv[40], run.x1[40], run.p1[50], run.ps[111]] == pytest.approx(values, rel=1e-9)


def test_noise_is_that_of_the_benchmark():
    scenario = Scenario('test', 200, cv=Constant(0.5))
    noisy, quiet, plain = (simulate(scenario, noise=noise) for noise in (True, 'cv', False))
    assert np.array_equal(noisy.cv, plain.cv)  # detectors get the undisturbed control value
    assert not np.array_equal(quiet.x1, plain.x1)  # the positioner gets the disturbed one
    for name in ('x1', 'p1', 'p2', 't1'):
        e = (noisy[name] - quiet[name])[8000:] / RANGES[name]
        assert e[np.arange(len(e)) % 4 == 0].std() == pytest.approx(1.414e-3, rel=0.05), name
        assert e[2::8].mean() == pytest.approx(0.0025, rel=0.05), name  # crest of the hum
    assert (noisy.ps - quiet.ps).std() == pytest.approx(80, rel=0.02)


def test_inject_clear_and_override():
    simulator = Simulator(Scenario('test', 60, cv=Constant(0.5)), rate=100)
    simulator.advance(2000)
    simulator.inject('f19', 0.5)
    faulty = simulator.advance(1000)
    assert set(faulty['fault']) == {19}
    simulator.clear()
    simulator.override_cv(0.8)
    cleared = simulator.advance(2000)
    assert set(cleared['fault']) == {0}
    assert set(cleared['cv']) == {0.8}
    assert cleared['x1'][-1] == pytest.approx(0.8, abs=0.02)
    assert cleared['flow'][0] == pytest.approx(2 * faulty['flow'][-1], rel=1e-6)
    simulator.override_cv(None)
    assert simulator.advance(1)['cv'][0] == 0.5
    with pytest.raises(ValueError, match=r'0\.\.1'):
        simulator.override_cv(1.5)
    with pytest.raises(ValueError, match='f8'):
        Simulator('paper_nominal', model='lugre').inject('f8')


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'scenario': 'f4_X'}, '--list'),
        ({'scenario': 'nominal', 'rate': 300}, '400 Hz'),
        ({'scenario': 'nominal', 'rate': 0}, 'rate'),
        ({'scenario': 'nominal', 'model': 'karnopp'}, 'dablib, lugre'),
        ({'scenario': 'nominal', 'noise': 'x1'}, 'noise'),
        ({'scenario': 'nominal', 'duration': float('inf')}, 'duration'),
    ],
)
def test_bad_argument_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        simulate(**arguments)


def test_many_runs_come_in_order():
    jobs = [{'scenario': 'random_nominal', 'seed': seed, 'duration': 20} for seed in range(9)]
    last = list(simulate_many(jobs, lambda run: run.x1[-1], workers=3))
    assert last == [simulate(**job).x1[-1] for job in jobs]


FAULTS = st.sampled_from(list(CATALOGUE.values())).flatmap(
    lambda kind: st.builds(
        Fault,
        st.just(kind.key),
        st.floats(kind.minimum, 1),
        st.floats(0, 20),
        st.floats(0, 20),
    )
)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    cv=st.lists(st.floats(0, 1), min_size=6, max_size=6),
    fault=FAULTS,
    model=st.sampled_from(MODELS),
    noise=st.booleans(),
)
def test_outputs_are_in_range_for_any_input(cv, fault, model, noise):
    if fault.fault == 'f8':
        model = 'dablib'
    scenario = Scenario('test', 30, cv=Steps(range(0, 30, 5), cv), faults=(fault,))
    simulator = Simulator(scenario, rate=200, model=model, noise=noise)
    run = simulator.advance(simulator.samples)
    for name, span in RANGES.items():
        assert np.all((run[name] >= 0) & (run[name] <= span)), name
    assert np.all(np.isfinite(run['ps']))
    assert np.all(
        (run['ps'] * (fault.fault != 'f14') >= -101325 - 500)
        & (run['ps'] * (fault.fault != 'f14') <= 700e3)
    )
    state = simulator._state[0]
    assert 0 < state['ma'] <= 0.1
    assert -0.05 * 0.0381 <= state['x'] <= 1.25 * 0.0381


@pytest.mark.parametrize('model', MODELS)
def test_same_source_runs_uncompiled(model):
    code = (
        'from damadics_plant import simulate; '
        f'run = simulate("paper_friction", model={model!r}, rate=50, duration=4); '
        'print(run.x1.tolist())'
    )
    environment = os.environ | {'NUMBA_DISABLE_JIT': '1', 'PYTHONPATH': os.pathsep.join(sys.path)}
    output = subprocess.run(
        [sys.executable, '-c', code], env=environment, check=True, capture_output=True, text=True
    ).stdout
    plain = [float(x) for x in output.strip('[]\n').split(',')]
    compiled = simulate('paper_friction', model=model, rate=50, duration=4).x1
    assert plain == pytest.approx(compiled, abs=1e-9)
    assert compiled[-1] > 0.05


def test_partial_strokes_go_to_both_sides_of_the_command_and_end():
    simulator = Simulator('nominal', rate=100.0, duration=30.0)
    before = simulator.advance(500)['cv'][-1]
    simulator.stroke(0.05, 2)
    cv = simulator.advance(1600)['cv'] - Simulator('nominal', rate=100.0).advance(2100)['cv'][500:]
    assert 0.05 < before < 0.95
    np.testing.assert_allclose(cv[:1600].reshape(4, 400), np.outer([1, -1, 1, -1], [0.05] * 400))
    simulator.stroke(0.05, 9)
    simulator.stroke(0.0, 0)
    rest = simulator.advance(400)['cv']
    np.testing.assert_array_equal(
        rest, Simulator('nominal', rate=100.0).advance(2500)['cv'][2100:]
    )
    with pytest.raises(ValueError, match='amplitude'):
        simulator.stroke(0.6, 1)
