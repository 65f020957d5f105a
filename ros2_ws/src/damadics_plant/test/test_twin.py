# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The twin of a valve: read from a file, refused with what is wrong in it."""

import pytest
from damadics_plant import LuGreActuator
from damadics_plant.actuator.twin import read_twin
from damadics_plant.command import main

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


@pytest.mark.parametrize(
    'change, reason',
    [
        ({'coulomb': None}, 'coulomb is missing'),
        ({'weight': 1.0}, 'weight is no constant'),
        ({'mass': 'heavy'}, "mass = 'heavy' is not a number"),
    ],
)
def test_a_wrong_twin_is_refused_with_what_is_wrong(tmp_path, change, reason, capsys):
    path = written(tmp_path / 'v.yaml', **change)
    with pytest.raises(ValueError, match=reason):
        read_twin(path)
    words = ['nominal', '--valve', str(path), '--out', str(tmp_path / 'a.csv'), '--quiet']
    assert main(words) == 1
    assert reason.split(' is')[0] in capsys.readouterr().err


def test_a_parameter_file_is_no_twin(tmp_path):
    (tmp_path / 'p.yaml').write_text('/**:\n  ros__parameters:\n    mass: 2.0\n')
    with pytest.raises(ValueError, match='holds no twin'):
        read_twin(tmp_path / 'p.yaml')
