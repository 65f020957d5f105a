# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The plants against the published facts of the benchmark and the paper's experiment."""

from pathlib import Path

import numpy as np
import pytest
from damadics_plant import simulate

SAMPLE = 0.0025 + 1e-9  # s, the tolerance of an instant
DATA = Path(__file__).parents[5] / 'shared' / 'data'


def first_rise(run, after):
    """Return the instant of the first sample above its predecessor."""
    rising = (np.diff(run.x1) > 0) & (run.t[1:] > after)
    return run.t[1:][rising][0]


@pytest.fixture(scope='module')
def nominal():
    return simulate('paper_nominal')


@pytest.mark.parametrize(
    ('after', 'instant'),
    [
        (0.0, 2.895),
        (30.5, 30.79),
        (50.5, 50.80),
        (80.2, 80.445),
    ],
)
def test_stem_breaks_away_on_time(nominal, after, instant):
    assert first_rise(nominal, after) == pytest.approx(instant, abs=SAMPLE)


def test_stem_position_of_the_paper_experiment(nominal):
    assert nominal.x1[28000] == pytest.approx(0.7211, abs=1e-4)
    assert nominal.x1[31960] == pytest.approx(0.3567, abs=1e-4)
    assert nominal.x1[8000] == pytest.approx(0.997, abs=5e-4)


def test_friction_holds_the_stem_until_it_breaks_away():
    run = simulate('paper_friction')
    assert first_rise(run, 80.2) == pytest.approx(81.1175, abs=SAMPLE)
    assert run.x1[32400] == pytest.approx(0.3886, abs=1e-4)
    assert run.strength[32448] == pytest.approx(0.556, abs=1e-6)
    assert run.x1[-1] == pytest.approx(0.851, abs=5e-4)


def test_spring_fault_throws_the_stem():
    run = simulate('paper_spring')
    assert first_rise(run, 69.0) == pytest.approx(70.0025, abs=SAMPLE)
    assert run.x1[28001:28003] == pytest.approx([0.773, 0.856], abs=5e-4)
    assert run.x1[28004] == 1.0


def test_agrees_with_the_original_simulink_model():
    file = DATA / 'simulink_dgen_nominal_900s.csv'
    if not file.exists():
        pytest.skip(f'{file} is not here: its licence keeps it out of the repository')
    reference = np.genfromtxt(file, delimiter=',', names=True)
    run = simulate('nominal', rate=1.0, duration=900.0)
    rows = slice(20, len(reference))
    x = reference['X_norm'][rows] - run.x1[rows]
    flow = reference['F_norm'][rows] - run.flow[rows] * 3.6 / 40
    assert x.std() < 0.0016
    assert abs(x.mean()) < 2e-4
    assert flow.std() < 0.0014


@pytest.mark.parametrize(
    ('t', 'x'),
    [
        (3, 0.017),
        (10, 0.876),
        (20, 0.997),
        (30, 0.728),
        (60, 0.996),
        (70, 0.725),
        (80, 0.358),
    ],
)
def test_lugre_stem_position(t, x):
    run = simulate('paper_nominal', model='lugre')
    assert run.x1[200 * t] == pytest.approx(x, abs=6e-4)
