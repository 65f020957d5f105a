# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Figures: spikes survive thinning, the picture is written."""

import numpy as np
import pytest
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.monitor import run
from damadics_fd.core.result import Result
from damadics_fd.core.settings import Settings
from damadics_fd.figures import decimation
from damadics_fd.figures.panels import envelope, six_panels


def test_thinning_keeps_every_extreme():
    rng = np.random.default_rng(0)
    y = rng.normal(size=100_000)
    y[[5, 50_000, 99_990]] = [40.0, -50.0, 60.0]
    t, thin = envelope(np.arange(100_000.0), y, points=500)
    assert len(thin) <= 502
    assert {40.0, -50.0, 60.0} <= set(thin)
    assert (np.diff(t) >= 0).all()


@pytest.mark.parametrize('known', [True, False])
def test_six_panels_are_drawn_with_and_without_the_truth(tmp_path, known):
    pytest.importorskip('matplotlib')
    n = 2000
    t = np.arange(n) / 400.0
    columns = {
        'stamp': (t * 1e9).astype(np.int64) + (0 if known else 1_700_000_000 * 10**9),
        'cv': (t > 1).astype(float),
        'x1': np.clip(t - 1, 0, 1),
    }
    if known:
        columns |= {'fault': np.where(t > 2, 11, 0), 'strength': (t > 2).astype(float)}
    result = run(columns, Settings.for_mode('paper'))
    path = six_panels(result, columns, tmp_path / 'new' / 'a.png', 'a title')
    assert path.read_bytes().startswith(b'\x89PNG')
    assert path.stat().st_size > 50_000


def test_rows_kept_for_a_picture_stay_few_and_hold_every_spike(monkeypatch):
    monkeypatch.setattr(decimation, 'MOST_ROWS', 2000)
    settings = Settings.for_mode('paper')
    thinner, rng, spikes, most = decimation.Thinner(), np.random.default_rng(1), [], 0
    for piece in range(600):
        rows = int(rng.integers(50, 400))
        stamp = (piece * 1000 + np.arange(rows)) * 1_000_000 + 1
        columns = {'stamp': stamp, 'cv': np.zeros(rows), 'x1': rng.random(rows)}
        result = Result(
            np.zeros(rows, np.uint8),
            Estimate.rows(rows),
            Decision.rows(rows),
            Estimator(settings),
            Detector(settings),
        )
        if piece % 50 == 7:
            spike = int(rng.integers(rows))
            result.estimates['xi2'][spike] = 5.0 + piece
            result.decisions['transitions'][rows // 2] = 1
            spikes.append((stamp[spike], 5.0 + piece, stamp[rows // 2]))
        thinner.add(columns, result)
        most = max(most, len(thinner.thinned()[0].reason))
    result, columns = thinner.thinned()
    assert most < 2500
    assert (np.diff(columns['stamp']) > 0).all()
    for stamp, height, event in spikes:
        row = np.searchsorted(columns['stamp'], stamp)
        assert columns['stamp'][row] == stamp
        assert result.estimates['xi2'][row] == height
        assert event in columns['stamp']
