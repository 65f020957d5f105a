# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""One monitor for every mode: what it says after a column is what it says after the samples."""

import math

import numpy as np
import pytest
from damadics_fd.core.modes import MODES
from damadics_fd.core.monitor import Monitor, monitor_for
from damadics_fd.core.quality import Reason, Refused
from damadics_fd.core.sample import COLUMNS, Sample
from damadics_fd.core.settings import Settings

from .test_paper import recording


def ended_badly(rate):
    """Return samples of which the last ten seconds are refused, each for its position."""
    columns = recording(800)
    columns['stamp'] = ((np.arange(800) + 1) * 1e9 / rate).astype(np.int64)
    columns['x1'][-round(10 * rate) :] = 1.5
    columns['x1'][-1] = math.nan
    return columns


@pytest.mark.parametrize('mode', MODES)
def test_a_column_leaves_the_monitor_as_its_samples_do(mode):
    settings = Settings.for_mode(mode, sample_rate=20.0)
    columns = ended_badly(20.0)
    one: Monitor = monitor_for(settings)
    other = monitor_for(settings)
    said = [
        one.update(Sample(*row))
        for row in zip(*(columns[name].tolist() for name in COLUMNS), strict=True)
    ]
    result = other.run(columns)
    assert [isinstance(answer, Refused) for answer in said] == (~result.accepted).tolist()
    assert said[-1] == Refused(Reason.NOT_FINITE, 'not_finite: x1 = nan', 'x1')
    assert other.estimator.refused == said[-1]
    assert other.estimator.failed_input == one.estimator.failed_input
    assert other.estimator.failed_input.startswith('not_finite: x1 = nan, for 10 s: check')
    assert other.estimator.failing.reason == Reason.NOT_FINITE
    assert str(other.detector.decision) == str(one.detector.decision)
    assert other.detector.decision.stamp == columns['stamp'][result.accepted][-1]
    assert other.status == one.status
    assert other.refused == one.refused


@pytest.mark.parametrize('mode', MODES)
def test_rows_of_refused_samples_hold_the_state_of_the_piece_before(mode):
    settings = Settings.for_mode(mode)
    columns = recording(600)
    whole = monitor_for(settings).run(columns)
    pieces = monitor_for(settings)
    decisions = []
    for first in range(0, 600, 100):  # the row at 100 is refused
        piece = {name: column[first : first + 100] for name, column in columns.items()}
        decisions.append(pieces.run(piece).decisions)
    joined = np.concatenate(decisions)
    assert not whole.accepted[100]
    for name in joined.dtype.names:
        np.testing.assert_array_equal(joined[name], whole.decisions[name], name)
