# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The likelihood ratio for friction believes the model as far as it was learned."""

import numpy as np
import pytest
from damadics_fd.core.scada.judging import decide
from damadics_fd.core.scada.judging.cusum import FRICTION_TEST, R1
from damadics_fd.core.scada.state import MONITOR, REFERENCE

SIGMA, STANDARD_ERROR = 0.002, 0.15


def evidence(lever, samples=100):
    """Return statistic over limit after samples whose error lies half way to a wider play."""
    s, ref = np.zeros(1, MONITOR)[0], np.zeros(1, REFERENCE)[0]
    ref.s1, ref.kap2, ref.llr_limit = SIGMA, 1.0, 10.0
    ref.se[:] = STANDARD_ERROR
    s.testable[R1], s.lever[R1] = 1, lever
    s.xd = 0.5
    for k in range(samples):
        s.xm[0] = 0.51 if k % 20 else 0.5
        wider = s.xm[0] - s.xd
        s.residual[R1] = -0.5 * wider - 0.1 * SIGMA
        decide.test_friction(s, ref)
    return s.ratios[FRICTION_TEST]


def test_a_small_misfit_is_friction_only_where_the_model_is_sure():
    assert evidence(lever=1.0) > 1.0
    assert evidence(lever=3.0) == pytest.approx(0.0)


@pytest.mark.parametrize(('apart', 'slips'), [(50, 1), (5, 10)])
def test_a_slip_counts_once_however_long_it_lasts(apart, slips):
    llr = before = 0.0
    for k in range(apart * slips):
        llr, before = decide.weigh(llr, before, 4.0, 3.0)
        if k % apart == apart - 1:
            llr, before = decide.weigh(llr, before, 0.0, 0.0)
    assert llr == pytest.approx(slips * decide.LLR_CLIP)
