# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Stamps: dates and simulated time."""

import pytest
from damadics_fd.core.stamps import SECOND, another_run, is_date, origin

pytestmark = pytest.mark.plain

NOW = 1_790_000_000 * SECOND
HOURS_28 = 28 * 3600 * SECOND


def test_a_long_simulation_counts_from_its_own_zero():
    assert not is_date(HOURS_28)
    assert origin(HOURS_28) == 0
    assert origin(NOW) == NOW


def test_another_run_is_told_by_simulated_time_that_went_back():
    assert another_run(HOURS_28, SECOND)
    assert not another_run(SECOND, HOURS_28)
    assert not another_run(NOW, SECOND)
    assert not another_run(NOW, NOW - 5 * SECOND)  # a clock set back
