# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Compile the hot loops into numba's cache, so that nodes start at once after a build.

`demo`: what one valve needs; `more`: the rest. Python's own code is compiled by being imported,
also where the environment forbids this (PYTHONDONTWRITEBYTECODE): without it the start of every
process takes 1 s of CPU time more.
"""

import os
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from importlib import import_module
from multiprocessing import get_context

import numpy as np

SAMPLE = {'cv': 0.5, 'x1': 0.5, 'p1': 3.5e6, 'p2': 2.6e6, 't1': 20.0, 'flow': 5.0, 'ps': 1e5}


def detector() -> None:
    """Compile what judges an estimate; the longest of all."""
    from damadics_fd.core.approximator.state import Estimate
    from damadics_fd.core.decision.detector import Detector
    from damadics_fd.core.settings import Settings

    Detector(Settings.for_mode('paper')).update(Estimate(*Estimate.rows().item()))


def the_others() -> None:
    """Compile estimator, reader of bags and plant."""
    from damadics_fd.bag.cdr import kernels
    from damadics_fd.core.approximator.estimator import Estimator
    from damadics_fd.core.settings import Settings
    from damadics_plant import simulate

    Estimator(Settings.for_mode('paper')).update(1, *SAMPLE.values())
    kernels.warm_up()
    simulate('nominal', model='dablib', duration=0.0)


def pipeline() -> None:
    """Compile the loop over columns, which is made of the steps above."""
    from damadics_fd.core.monitor import run
    from damadics_fd.core.settings import Settings

    columns = {name: np.array([value]) for name, value in SAMPLE.items()}
    run({'stamp': np.array([1]), **columns}, Settings.for_mode('paper'))


def control_room() -> None:
    """Compile what learns and judges a recording in mode scada."""
    from damadics_fd.core.monitor import run
    from damadics_fd.core.sample import SIGNALS
    from damadics_fd.core.settings import Settings
    from damadics_plant import simulate

    day = simulate('random_nominal', rate=1.0, noise=True, duration=1200.0)
    columns = {name: np.array(day[name]) for name in SIGNALS}
    run(
        {'stamp': np.arange(len(columns['cv'])) * 1_000_000_000, **columns},
        Settings.for_mode('scada'),
    )


def bank(mode: str) -> None:
    """Compile the loop over rows of many valves, which is made of the same steps."""
    from damadics_fd.core.bank.bank import Bank
    from damadics_fd.core.settings import Settings

    row = {name: np.array([value]) for name, value in SAMPLE.items()}
    Bank([Settings.for_mode(mode)]).take(np.array([0]), np.array([1]), row)


def pair() -> None:
    """Compile the call for one sample that estimator and detector of one process share."""
    from damadics_fd.core.bank.pair import warm_up

    warm_up()


def lugre() -> None:
    """Compile the second model of the plant."""
    from damadics_plant import simulate

    simulate('nominal', model='lugre', duration=0.0)


def imports(*modules: str) -> None:
    """Have the byte code of executables written."""
    for module in modules:
        import_module(module)


EXECUTABLES = (
    'damadics_fd.commands.record',
    'damadics_fd.nodes.detector_node',
    'damadics_fd.nodes.estimator_node',
    'damadics_plant.plant',
    'damadics_bringup.demo',
)
MORE_EXECUTABLES = (
    'damadics_fd.nodes.monitors',
    'damadics_fd.nodes.fleet.fleet_node',
    'damadics_fd.commands.replay.replay',
    'damadics_bringup.launcher',
    'damadics_dashboard.dashboard',
    'damadics_connect.opcua.command',
    'damadics_connect.mqtt.command',
    'damadics_connect.http.command',
    'damadics_connect.notify.command',
)
Task = tuple[Callable[..., None], tuple[str, ...]]
STAGES: dict[str, list[list[Task]]] = {  # the tasks of an inner list go on at the same time
    'demo': [[(imports, EXECUTABLES)], [(detector, ()), (the_others, ())], [(pipeline, ())]],
    'more': [
        [
            (bank, ('paper',)),
            (bank, ('scada',)),
            (pair, ()),
            (lugre, ()),
            (control_room, ()),
            (imports, MORE_EXECUTABLES),
        ],
    ],
}


def main(names: list[str]) -> None:
    """Do the stages that are named, all by default."""
    os.environ.pop('PYTHONDONTWRITEBYTECODE', None)  # of the processes started below
    with ProcessPoolExecutor(2, mp_context=get_context('spawn')) as pool:
        for name in names or STAGES:
            for tasks in STAGES[name]:
                for done in [pool.submit(task, *arguments) for task, arguments in tasks]:
                    done.result()


if __name__ == '__main__':
    main(sys.argv[1:])
