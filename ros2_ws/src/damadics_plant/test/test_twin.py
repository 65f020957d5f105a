# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The twin of a valve: read from a file, refused with what is wrong in it."""

import numpy as np
import pytest
import yaml
from damadics_fd.commands.commission.command import main as commission
from damadics_fd.commands.commission.monitor import identify
from damadics_fd.commands.commission.twin.constants import twin
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.document import COMMISSION, ValveDocument, section
from damadics_fd.core.settings.identified import VERDICTS, FaultFree
from damadics_plant import Actuator, LuGreActuator, Scenario, simulate
from damadics_plant.actuator.twin import ENTRY, Origin, origin, parts_of, read_twin, twin_of
from damadics_plant.command import main
from damadics_plant.scenarios.sources import RandomSteps, Sine, Steps

VALUES = {
    'stroke': 0.05,
    'mass': 6.0,
    'stiffness': 9e4,
    'area': 0.035,
    'dead_volume': 6e-3,
    'supply': 6e5,
    'coulomb': 200.0,
    'static': 260.0,
}
ERRORS = [0.01 * k for k in range(-15, 16)]


def written(path, **changes):
    values = {name: v for name, v in {**VALUES, **changes}.items() if v is not None}
    lines = ['twin:', "  actuator: 'LV-101'", '  sample_rate: 200.0']
    path.write_text('\n'.join(lines + [f'  {n}: {v}' for n, v in values.items()]) + '\n')
    return path


def test_a_twin_is_an_actuator_with_its_constants(tmp_path):
    actuator = read_twin(written(tmp_path / 'v.yaml'))
    assert isinstance(actuator, LuGreActuator)
    assert (actuator.coulomb, actuator.stroke) == (200.0, 0.05)
    assert actuator.gain == LuGreActuator().gain


@pytest.mark.parametrize('opens', [0.0, 1.0])
def test_a_positioner_of_ones_own_holds_the_valve_at_its_set_point(tmp_path, opens):
    openings = [min(max(8.0 * error, -1.0), 1.0) for error in ERRORS]
    own = {'errors': ERRORS, 'openings': openings, 'hold': 0.005, 'lag': 0.01}
    valve = {'air_opens': opens, 'flow_closes': opens, 'reset_rate': 0.3, **own}
    actuator = read_twin(written(tmp_path / 'v.yaml', **valve))
    scenario = Scenario('step', 40.0, cv=Steps([0.0, 20.0], [0.7, 0.3]))
    x = simulate(scenario, rate=100.0, model=actuator)['x1']
    assert x[0] == opens  # where the spring has moved it
    assert (x[1900], x[-1]) == pytest.approx((0.7, 0.3), abs=0.02)


def test_a_rate_that_no_plant_can_play_is_not_taken(tmp_path):
    path = written(tmp_path / 'v.yaml')
    assert origin(parts_of(path)[ENTRY]) == Origin('LV-101', 200.0)
    path.write_text(path.read_text().replace('200.0', '5000.0', 1))
    assert origin(parts_of(path)[ENTRY]) == Origin('LV-101', None)


@pytest.mark.parametrize(
    'change, reason',
    [
        ({'coulomb': None}, 'coulomb is missing'),
        ({'weight': 1.0}, 'weight is no constant'),
        ({'mass': 'heavy'}, "mass = 'heavy' is not a number"),
        ({'recovery': [1.0, 0.5]}, 'recovery is not 12 numbers, positive'),
        ({'openings': [1.0] * 31, 'errors': ERRORS}, 'openings is not 31 numbers, rising'),
        ({'errors': ERRORS}, 'errors and openings belong together'),
    ],
)
def test_a_wrong_twin_is_refused_with_what_is_wrong(tmp_path, change, reason, capsys):
    path = written(tmp_path / 'v.yaml', **change)
    with pytest.raises(ValueError, match=reason):
        read_twin(path)
    words = ['nominal', '--valve', str(path), '--out', str(tmp_path / 'a.csv'), '--quiet']
    assert main(words) == 2
    assert reason.split(' is')[0] in capsys.readouterr().err


def test_the_file_of_a_valve_runs_as_it_is(tmp_path, capsys):
    good, valve = tmp_path / 'good.csv', tmp_path / 'lv101.yaml'
    words = ['random_nominal', '--model', 'lugre', '--rate', '100', '--duration', '120']
    assert main([*words, '--quiet', '--out', str(good)]) == 0
    assert commission([str(good), '--actuator', 'LV-101', '--out', str(valve)]) == 0
    content = yaml.safe_load(valve.read_text())
    judged = section(content, COMMISSION)
    assert judged['verdict'] in VERDICTS
    assert any(line.startswith('verdict') for line in judged['report'])
    assert 0.0 < judged['friction_in_an_hour'] <= judged['friction_in_a_minute'] < 1.0
    document = ValveDocument.read(content)
    assert (document.actuator, document.settings.sample_rate) == ('LV-101', 100.0)
    assert read_twin(valve).stiffness == document.settings.stiffness
    assert parts_of(valve)['settings']['stiffness'] == document.settings.stiffness
    assert origin(parts_of(valve)[ENTRY]) == ('LV-101', 100.0)
    again = tmp_path / 'again.csv'
    words = ['nominal', '--valve', str(valve), '--duration', '10']
    assert main([*words, '--quiet', '--out', str(again)]) == 0
    assert len(again.read_text().splitlines()) == 1002  # at the rate of the file, and a header


@pytest.mark.parametrize('plant', [Actuator, LuGreActuator])
def test_a_twin_moves_as_the_valve_did(plant):
    build = plant(lag=0.42, air_flow=1.9e-6)
    scenario = Scenario(
        name='strokes',
        duration=480.0,
        cv=RandomSteps(seed=5),
        p1=Sine(3.5e6, 7e4, 0.1),
        p2=Sine(2.6e6, 2.6e4, 0.3),
    )
    truth = simulate(scenario, rate=200.0, model=build)
    rng, half = np.random.default_rng(5), len(truth['x1']) // 2
    noise = {'x1': 5e-4, 'ps': 150.0, 'p1': 2e3, 'p2': 2e3}
    columns = {name: np.array(truth[name])[:half] for name in ('stamp', 'cv', *noise)}
    for name, std in noise.items():
        columns[name] = columns[name] + std * rng.standard_normal(half)
    found = twin(identify([FaultFree('first half', columns)], Settings.for_mode('monitor')))
    assert found['lag'] == pytest.approx(build.lag, rel=0.15)
    if 'openings' not in found:  # whose flow is beside the law that they come with
        assert found['air_flow'] == pytest.approx(build.air_flow, rel=0.05)
    again = simulate(scenario, rate=200.0, model=twin_of(found, 'here'))
    error = (again['x1'] - truth['x1'])[half:]
    assert np.sqrt(np.mean(error**2)) < 0.01


def test_a_parameter_file_is_no_twin(tmp_path):
    (tmp_path / 'p.yaml').write_text('/**:\n  ros__parameters:\n    mass: 2.0\n')
    with pytest.raises(ValueError, match='holds no twin'):
        read_twin(tmp_path / 'p.yaml')
