# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compile the hot loops into numba's cache, so that nodes start at once after a build."""

import numpy as np
from damadics_fd.bag import kernels
from damadics_fd.core.detector import Detector
from damadics_fd.core.estimator import Estimator
from damadics_fd.core.pipeline import run
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.settings import Settings
from damadics_plant import simulate

SAMPLE = (0.5, 0.5, 3.5e6, 2.6e6, 20.0, 5.0, 1e5)

settings = Settings.for_mode('paper')
estimate = Estimator(settings).update(1, *SAMPLE)
Detector(settings).update(estimate)
names = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
columns = {name: np.array([value]) for name, value in zip(names, SAMPLE, strict=True)}
run({'stamp': np.array([1]), **columns}, settings)
kernels.warm_up()
for model in ('dablib', 'lugre'):
    simulate('nominal', model=model, duration=0.0)
monitor = ScadaMonitor()
monitor.run(simulate('f11@0.5', rate=1.0, duration=960.0))
monitor.isolate()
