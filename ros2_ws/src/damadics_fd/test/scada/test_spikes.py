# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Single wrong samples of CV, which move the model and not the stem."""

import numpy as np
import pytest
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor

from .driven import SETTINGS, driven

CV = 1
WRONG = slice(55, None, 30)
STEPS = {'swing': 0.2, 'jump': 0.1}  # where CV jumps by itself, a jump is no reason to wait


@pytest.fixture(scope='module', params=[False, True], ids=['learned without', 'learned with'])
def reference(request):
    """Learn the stated actuator, from a record that may have wrong samples of CV itself."""
    rows = driven(270, seed=1, **STEPS)
    if request.param:
        rows[WRONG, CV] += 0.2
    return learn(rows, SETTINGS)


@pytest.mark.parametrize('off', [-0.2, 0.1, 0.2])
def test_a_wrong_sample_of_cv_raises_nothing(reference, off):
    rows = driven(300, seed=5, **STEPS)
    rows[WRONG, CV] = np.clip(rows[WRONG, CV] + off, 0.0, 1.0)
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert not trace['alarm'].any()


def test_a_fault_between_wrong_samples_is_found(reference):
    rows = driven(300, 6, 155, f13=0.25, **STEPS)
    rows[WRONG, CV] += 0.2
    trace = ScadaMonitor(SETTINGS, reference).run_samples(rows)
    assert 155.0 <= trace['t'][trace['alarm']][0] < 175.0
