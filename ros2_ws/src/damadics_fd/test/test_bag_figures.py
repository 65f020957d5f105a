# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Figures: spikes survive thinning, the picture is written."""

import numpy as np
import pytest
from damadics_fd.core.pipeline import run
from damadics_fd.core.settings import Settings
from damadics_fd.figures import envelope, six_panels


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
        'cv': (t > 1).astype(float), 'x1': np.clip(t - 1, 0, 1),
    }
    if known:
        columns |= {'fault': np.where(t > 2, 11, 0), 'strength': (t > 2).astype(float)}
    result = run(columns, Settings.for_mode('paper'))
    path = six_panels(result, columns, tmp_path / 'new' / 'a.png', 'a title')
    assert path.read_bytes().startswith(b'\x89PNG')
    assert path.stat().st_size > 50_000
