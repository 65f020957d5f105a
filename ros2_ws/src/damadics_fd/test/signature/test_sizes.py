# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sizes of friction on the simulated LuGre actuator, whose friction grows at every speed."""

import numpy as np
import pytest
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_plant import Fault, LuGreActuator, Scenario, simulate
from damadics_plant.scenarios.sources import RandomSteps, Sine

NOISE = {'x1': 1e-3, 'ps': 80.0}


@pytest.mark.parametrize('seed', [20003, 20005])
def test_friction_at_low_speed_is_not_taken_for_dry_friction(seed):
    scenario = Scenario(
        'friction times four',
        335.0,
        cv=RandomSteps(seed=seed),
        faults=(Fault('f4', 0.15, 155.0),),
        p1=Sine(3.5e6, 175e3, 0.1),
        p2=Sine(2.6e6, 26e3, 0.3),
    )
    plant = LuGreActuator(coulomb=22.0, static=35.0)
    columns = dict(simulate(scenario, 200.0, plant, seed=seed))
    rng = np.random.default_rng(seed)
    for name, std in NOISE.items():
        columns[name] = columns[name] + std * rng.standard_normal(len(columns[name]))
    last = run(columns, Settings.for_mode('monitor', t_learn=60.0)).decisions[-1]
    assert float(last['strength']) == pytest.approx(3.0, abs=0.1)
    assert abs(float(last['strength']) - 3.0) < 2.0 * float(last['spread'])
