# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The DAMADICS actuator: control valve, servomotor and positioner with the benchmark's 19 faults.

>>> from damadics_plant import simulate
>>> run = simulate('paper_friction')
>>> run.t[-1], run.fault[-1]
(np.float64(120.0), np.int64(4))
"""

from damadics_plant.actuator.parameters import Actuator, LuGreActuator
from damadics_plant.faults.catalogue import CATALOGUE, Fault
from damadics_plant.run import Run
from damadics_plant.scenarios.file import ScenarioError, read_scenarios
from damadics_plant.scenarios.library import load_scenario, scenario_names
from damadics_plant.scenarios.scenario import Scenario
from damadics_plant.simulator import Simulator, simulate

__all__ = [
    'CATALOGUE',
    'Actuator',
    'Fault',
    'LuGreActuator',
    'Run',
    'Scenario',
    'ScenarioError',
    'Simulator',
    'load_scenario',
    'read_scenarios',
    'scenario_names',
    'simulate',
]
