# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Short records through every mode, also as plain Python.

`make coverage` runs them with NUMBA_DISABLE_JIT=1: of compiled code no coverage is seen.
"""

from pathlib import Path

import numpy as np
import pytest
from damadics_fd.bag import read_columns
from damadics_fd.causes import load_causes
from damadics_fd.core.modes import PHASE_MONITOR
from damadics_fd.core.monitor import monitor_for, run
from damadics_fd.core.sample import SIGNALS, Sample
from damadics_fd.core.settings import Settings

pytestmark = pytest.mark.plain
BAGS = Path(__file__).parents[5] / 'bags'
EVERY = 8  # of the recorded samples, which are 5 ms apart
ONSET = 70.0  # s
QUICK = {'sample_rate': 25.0, 't_on': 1.0, 't_w': 3.0, 't_learn': 8.0, 'travel_min': 0.1}


def recorded(name: str) -> dict[str, np.ndarray]:
    columns = read_columns(BAGS / f'lugre_{name}.mcap', '/measurement', [*SIGNALS])
    return {key: column[::EVERY] for key, column in columns.items()}


@pytest.mark.parametrize('name', ['friction', 'spring'])
def test_a_fault_is_found_in_a_record_of_75_s(name):
    result = run(recorded(name), Settings.for_mode('monitor', **QUICK))
    raised = [event.stamp * 1e-9 for event in result.detections]
    assert len(raised) == 1
    assert ONSET < raised[0] < ONSET + 4.0


def test_nothing_is_found_where_nothing_is_wrong():
    result = run(recorded('nominal'), Settings.for_mode('monitor', **QUICK))
    assert result.detections == []
    assert result.estimates['phase'][-1] == PHASE_MONITOR


def test_mode_paper_reads_a_record_from_zero_weights():
    columns = {name: column[:200] for name, column in recorded('friction').items()}
    result = run(columns, Settings.for_mode('paper', sample_rate=25.0))
    assert len(result.estimates) == len(result.reason)
    assert np.isfinite(result.estimates['xi2'][result.accepted]).all()


def test_sample_by_sample_gives_the_same_bits_as_a_whole_record():
    columns = {name: column[:600] for name, column in recorded('spring').items()}
    settings = Settings.for_mode('monitor', **QUICK)
    whole = run(columns, settings)
    one = monitor_for(settings, load_causes().classes)
    for n in range(600):
        decision = one.update(Sample(*(columns[name][n].item() for name in ('stamp', *SIGNALS))))
    last = whole.decisions[-1]
    assert (decision.residual, decision.threshold) == (last.residual, last.threshold)
