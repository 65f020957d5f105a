# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compile the hot loops into numba's cache, so that nodes start at once after a build."""

from concurrent.futures import ProcessPoolExecutor
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
    for model in ('dablib', 'lugre'):
        simulate('nominal', model=model, duration=0.0)


def pipeline() -> None:
    """Compile the loop over columns, which is made of the steps above."""
    from damadics_fd.core.monitor import run
    from damadics_fd.core.settings import Settings

    columns = {name: np.array([value]) for name, value in SAMPLE.items()}
    run({'stamp': np.array([1]), **columns}, Settings.for_mode('paper'))


def bank(mode: str) -> None:
    """Compile the loop over rows of many valves, which is made of the same steps."""
    from damadics_fd.core.bank import Bank
    from damadics_fd.core.settings import Settings

    row = {name: np.array([value]) for name, value in SAMPLE.items()}
    Bank([Settings.for_mode(mode)]).take(np.array([0]), np.array([1]), row)


if __name__ == '__main__':
    with ProcessPoolExecutor(2, mp_context=get_context('spawn')) as pool:
        for done in [pool.submit(detector), pool.submit(the_others)]:
            done.result()
        for done in [
            pool.submit(pipeline),
            pool.submit(bank, 'paper'),
            pool.submit(bank, 'scada'),
        ]:
            done.result()
