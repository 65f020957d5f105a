# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A line is sure where it was learned and unsure elsewhere; a test that sums up knows both."""

import math

import numpy as np
import pytest
from damadics_fd.core.scada.judging.cusum import R2, TESTS
from damadics_fd.core.scada.judging.decide import decide
from damadics_fd.core.scada.judging.leverage import lever, more_unsure
from damadics_fd.core.scada.judging.residuals import flow_residual
from damadics_fd.core.scada.state import MONITOR, NOMINAL, REFERENCE

SLOWEST = [(test.residual, test.k0) for test in TESTS].index((R2, 0.05))
STANDARD_ERROR = 0.08
SAMPLES = 1500


def summed(course):
    """Return the standard errors that a course of distances costs a sum."""
    s = np.zeros(1, MONITOR)[0]
    return sum(more_unsure(s, SLOWEST, 0, away) for away in course)


def evidence(course, shift):
    """Return statistic over limit of the slowest test of r2 after a small lasting shift, sigma."""
    s, ref = np.zeros(1, MONITOR)[0], np.zeros(1, REFERENCE)[0]
    ref.sd[SLOWEST], ref.k[SLOWEST], ref.h[SLOWEST] = 1.0, 0.05 + STANDARD_ERROR, 60.0
    ref.clip[SLOWEST], ref.se[SLOWEST] = 4.0, STANDARD_ERROR
    ref.llr_limit = ref.s1 = ref.kap2 = 1.0
    s.testable[R2] = 1
    s.residual[:] = math.nan
    for away in course:
        s.t += 1.0
        s.away[1], s.lever[1] = away, lever(away)
        s.residual[R2] = shift
        decide(s, ref)
    return s.ratios[SLOWEST]


def there_and_back(n, period=60):
    return 2.0 * np.sin(2.0 * np.pi * np.arange(n) / period)


def test_one_sample_is_as_unsure_as_its_place():
    assert summed([3.0]) == pytest.approx(lever(3.0) - 1.0)


def test_a_stay_elsewhere_costs_what_is_unsure_there():
    assert summed([2.0] * 500) == pytest.approx(500 * (lever(2.0) - 1.0))


def test_motion_about_the_middle_costs_next_to_nothing():
    assert summed(there_and_back(SAMPLES)) < 0.02 * SAMPLES * (lever(1.4) - 1.0)


def test_the_way_back_is_no_evidence():
    s = np.zeros(1, MONITOR)[0]
    cost = [more_unsure(s, SLOWEST, 0, away) for away in [3.0] * 100 + [-3.0] * 100]
    assert min(cost) == 0.0


def test_a_slow_fault_is_found_as_early_where_the_valve_works_as_it_did():
    shift = 0.05 + 2.0 * STANDARD_ERROR
    middle = evidence(np.zeros(SAMPLES), shift)
    assert middle > 1.0
    assert evidence(there_and_back(SAMPLES), shift) > 0.95 * middle
    assert evidence(np.full(SAMPLES, 2.0), shift) == 0.0, 'there the line may be off by as much'


def test_the_flow_is_taken_as_stated_where_no_line_was_learned():
    """As a record at the end of the meter leaves it: no sigma, nothing to divide by."""
    s, ref = np.zeros(1, MONITOR)[0], np.zeros(1, REFERENCE)[0]
    ref.flow_kind, ref.g1, ref.f_sd = NOMINAL, 1.0, 1.0
    s.f, s.sq = 0.4, 0.002
    plain = getattr(flow_residual, 'py_func', flow_residual)  # compiled code divides by 0 silently
    with np.errstate(all='raise'):
        assert plain(s, ref, 0.5, 0.41) == pytest.approx(5.0)
    assert s.lever[1] == pytest.approx(lever(0.4))
