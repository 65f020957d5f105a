# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `evaluate detectability` reads of a twin, and what it finds on it."""

from dataclasses import asdict

import pytest
import yaml
from damadics_evaluate.detectability import OPERATION, read_valve, trial
from damadics_plant.actuator.parameters import LuGreActuator


def file_of(folder, **more):
    content = {'twin': {'actuator': 'LV-1', 'sample_rate': 200.0, **asdict(LuGreActuator())}}
    path = folder / 'lv_1.twin.yaml'
    path.write_text(yaml.safe_dump(content | more), encoding='utf-8')
    return path


def test_a_twin_works_as_its_valve_did(tmp_path):
    assert read_valve(file_of(tmp_path)).operation == OPERATION
    valve = read_valve(file_of(tmp_path, operation={'p1': 2e6, 'ps_noise': 80.0}))
    assert valve.operation == OPERATION | {'p1': 2e6, 'ps_noise': 80.0}
    for wrong in ({'p1': -1.0}, {'p1': 'high'}, {'p3': 1.0}):
        with pytest.raises(ValueError, match=r'operation: p[13]'):
            read_valve(file_of(tmp_path, operation=wrong))


def test_a_soft_spring_of_a_twin_is_found_and_named(tmp_path):
    valve = read_valve(file_of(tmp_path, settings={'t_learn': 60.0}))
    found = trial(valve, 'spring', -0.2, seed=3)
    assert (found.false_alarms, found.cause) == (0, 'spring_softer')
    assert found.delay < 10.0 and found.size == pytest.approx(-0.2, abs=0.02)
