# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Table of the paper's experiments: what counts as a detection, what as an alarm before it."""

import numpy as np
from damadics_evaluate.benchmark.paper import Row, _limited, _rising, _scada


def test_rising_edges():
    t = np.arange(6.0)
    assert _rising(t, np.array([1, 1, 0, 1, 0, 1], bool)).tolist() == [0.0, 3.0, 5.0]


def test_cells_split_alarms_at_the_fault():
    alarms = {
        'paper_nominal': np.array([3.0]),
        'paper_friction': np.array([3.0, 30.8, 81.12, 90.0]),
        'paper_spring': np.array([]),
    }
    assert Row('x', alarms).cells() == ['x', '81.1200', 'not detected', '2 / 0', '1']


def test_limits_keep_the_fault_free_runs_quiet():
    def run(peak):
        return {'stamp': np.arange(3) * 10**9, 'y': np.array([0.0, peak, 0.0])}

    noisy = {'paper_nominal': run(1.0), 'paper_friction': run(2.0), 'paper_spring': run(1.3)}
    found = _limited(lambda c: c['y'], noisy, [run(1.0), run(1.1)])
    assert found['paper_nominal'].size == 0
    assert found['paper_friction'].tolist() == [1.0]
    assert found['paper_spring'].tolist() == [1.0]  # 1.3 against 1.1 x 1.1


def test_the_control_room_mode_finds_friction_and_spring_in_fast_strokes():
    alarms = _scada()
    assert alarms['paper_nominal'].size == 0
    assert 70.0 <= alarms['paper_friction'].min() <= 90.0
    assert 70.0 <= alarms['paper_spring'].min() <= 75.0
