# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Scenarios by name and from files of a user, right and wrong ones; recorded inputs."""

from pathlib import Path

import numpy as np
import pytest
from damadics_plant import ScenarioError, load_scenario, read_scenarios, scenario_names, simulate
from damadics_plant.scenarios.recorded import read_recorded
from damadics_plant.scenarios.scenario import Scenario

DATA = Path(__file__).parents[5] / 'shared' / 'data'
MODES = {  # tables 28 and 29 of DABLib's manual
    1: 'SMB',
    2: 'BI',
    3: 'I',
    4: 'I',
    5: 'I',
    6: 'I',
    7: 'SMB',
    8: 'SMB',
    9: 'I',
    10: 'SMB',
    11: 'BI',
    12: 'SMB',
    13: 'SMBI',
    14: 'SMB',
    15: 'B',
    16: 'SMB',
    17: 'BI',
    18: 'SMBI',
    19: 'SMB',
}
STRENGTH = {'S': 0.25, 'M': 0.5, 'B': 0.75, 'I': 1.0}


def test_standard_scenarios():
    standard = {f'f{fault}_{mode}' for fault, modes in MODES.items() for mode in modes}
    assert len(standard) == 44
    assert standard | {'nominal', 'paper_nominal', 'paper_friction', 'paper_spring'} <= set(
        scenario_names()
    )
    for name in standard:
        (fault,) = load_scenario(name).faults
        kind, mode = name.split('_')
        hours = {'f4': 3600, 'f13': 900, 'f17': 3600}
        assert fault.fault == kind
        assert fault.strength == STRENGTH[mode]
        assert fault.start == 900
        assert fault.direction == (-1 if kind in ('f12', 'f14', 'f19') else 1)
        assert fault.development == (hours.get(kind, 86400) if mode == 'I' else 0)
        assert load_scenario(name).duration == 1500 + fault.development


def test_every_scenario_says_what_it_is():
    assert all(load_scenario(name).description for name in scenario_names())


def test_fault_of_any_strength_by_name():
    (fault,) = load_scenario('f12@-0.37').faults
    assert (fault.fault, fault.strength, fault.start) == ('f12', -0.37, 900)


def test_scenario_of_a_user(tmp_path):
    file = tmp_path / 'mine.yaml'
    (tmp_path / 'cv.csv').write_text('t,CV\n0,40\n10,60\n20,nan\n30,60\n')
    file.write_text("""
.base: &base {duration: 30, t1: 43, p1: 3.5e6}
held: {<<: *base, cv: {recorded: {file: cv.csv, column: CV, scale: 0.01, hold: true}}}
line: {<<: *base, cv: {recorded: {file: cv.csv, column: CV, scale: 0.01}}}
random: {<<: *base, cv: {random_steps: {low: 0.2, high: 0.4, seed: 3}}}
""")
    assert list(read_scenarios(file)) == ['held', 'line', 'random']
    assert simulate(f'{file}:held', rate=1).cv[[0, 9, 10, 30]].tolist() == [0.4, 0.4, 0.6, 0.6]
    assert simulate(f'{file}:line', rate=1).cv[5] == pytest.approx(0.5)
    cv = [simulate(f'{file}:random', rate=1, seed=seed).cv for seed in (1, 2)]
    assert np.array_equal(*cv)  # the scenario's own seed wins
    assert 0.2 <= cv[0].min() < cv[0].max() <= 0.4
    with pytest.raises(ScenarioError, match='held, line, random'):
        load_scenario(str(file))


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('a: {duration: 10, cw: 1}', 'cw: is unknown; allowed: description, duration, cv'),
        ('a: {cv: 1}', 'duration: is missing'),
        ('a: {duration: ten}', "duration: 'ten' is no number"),
        ('a: {duration: -1}', 'not within 0'),
        (f'a: {{duration: 1{"0" * 400}}}', '0 is no number'),
        ('a: {duration: 1, faults: [{fault: f1, direction: .inf}]}', r'faults\[0\]'),
        ('a: {duration: 1, cv: {square: 1}}', 'steps, sine, random_steps, recorded, level_loop'),
        ('a: {duration: 1, cv: {steps: [[0, 1], [0, 2]]}}', 'times must increase'),
        ('a: {duration: 1, cv: {steps: 1}}', r'wants a list of \[time in s, value\]'),
        ('a: {duration: 1, cv: {sine: {means: 1}}}', 'cv.sine.means: is unknown; allowed: mean'),
        ('a: {duration: 1, p1: {level_loop: }}', 'level_loop drives cv only'),
        ('a: {duration: 1, cv: {recorded: {file: no.csv, column: x}}}', 'cannot be read'),
        ('a: {duration: 1, faults: {fault: f1}}', 'faults: wants a list'),
        ('a: {duration: 1, faults: [{fault: f20}]}', r"faults\[0\].fault: 'f20' is not one of f1"),
        ('a: {duration: 1, faults: [{fault: f1, strength: 2}]}', '2 is not within 0..1'),
        ('a: {duration: 1, faults: [{fault: f1, form: 2}]}', 'form: is unknown; allowed: fault'),
        ('[1, 2]', 'mapping of scenario names'),
        ('a: {', 'is no YAML'),
    ],
)
def test_error_names_file_key_and_what_is_allowed(tmp_path, text, message):
    file = tmp_path / 'wrong.yaml'
    file.write_text(text)
    with pytest.raises(ScenarioError, match=message) as error:
        load_scenario(str(file))
    assert str(file) in str(error.value)


def test_all_errors_come_at_once(tmp_path):
    file = tmp_path / 'wrong.yaml'
    file.write_text('a: {duration: x, p1: y}\nb: {}')
    with pytest.raises(ScenarioError) as error:
        read_scenarios(file)
    assert len(str(error.value).splitlines()) == 3


def test_recorded_signal_errors_name_what_there_is(tmp_path):
    file = tmp_path / 'a.csv'
    file.write_text('t,CV\n0,1\n')
    with pytest.raises(ValueError, match='it has t, CV'):
        read_recorded(file, 'CW')
    file.write_text('x,CV\n0,1\n')
    with pytest.raises(ValueError, match='no time column'):
        read_recorded(file, 'CV')
    file.write_text('t,CV\n0,\n')
    with pytest.raises(ValueError, match='no numbers'):
        read_recorded(file, 'CV')


def test_follows_the_real_valve():
    file = DATA / 'lublin_actuator3_20min_1hz.csv'
    if not file.exists():
        pytest.skip(f'{file} is not here: its licence keeps it out of the repository')
    real = np.genfromtxt(file, delimiter=',', names=True)
    scenario = Scenario(
        'Lublin',
        real['t_s'][-1],
        cv=read_recorded(file, 'LC74_20CV_CV_pct', 0.01),
        p1=read_recorded(file, 'P74_00_P1_kPa', 1e3),
        p2=read_recorded(file, 'P74_01_P2_kPa', 1e3),
        t1=read_recorded(file, 'T74_00_T1_degC'),
    )
    error = (simulate(scenario, rate=1).x1 - real['L74_20X_X_pct'] / 100)[30:]
    assert abs(error.mean()) < 0.01
    assert error.std() < 0.02
