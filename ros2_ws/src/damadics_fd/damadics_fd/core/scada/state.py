# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the SCADA-rate monitor keeps: the learned reference, the state, the last samples."""

import numpy as np

from damadics_fd.core.scada.cusum import TESTS
from damadics_fd.core.scada.model import FAULTS, STEM
from damadics_fd.core.scada.pressure import PRESSURE, TAPS

N_TESTS = len(TESTS)
N_WEIGHTS = 11
BASIC_WEIGHTS = 3  # constant, gain, CV slope; the others only where they earn their place
HISTORY_LENGTH = 1536

HISTORY = np.dtype(
    (
        np.record,
        [
            (name, np.float64)
            for name in (
                't0',
                't',
                'cv0',
                'cv',
                'dp0',
                'dp',
                'slope0',
                'slope',
                'x',
                'p1',
                'p2',
                't1',
                'flow',
                'correction',
                'f',
                'sq',
                'r1',
                'r2',
                'xm',
            )
        ]
        + [('stem', STEM), ('masked', np.bool_)],
    )
)

REFERENCE = np.dtype(
    (
        np.record,
        [
            ('pressure', PRESSURE, (2,)),
            ('hold', np.bool_),  # CV is held between samples
            ('cv_jump', np.float64),  # change of CV between two samples that was not learned
            ('w', np.float64, (N_WEIGHTS,)),
            ('dp_mean', np.float64),
            ('g0', np.float64),
            ('g1', np.float64),
            ('mu', np.float64, (N_TESTS,)),
            ('sd', np.float64, (N_TESTS,)),
            ('k', np.float64, (N_TESTS,)),
            ('h', np.float64, (N_TESTS,)),
            ('clip', np.float64, (N_TESTS,)),
            ('s1', np.float64),
            ('kap2', np.float64),
            ('llr_limit', np.float64),
            ('n', np.int64),
        ],
    )
)

MONITOR = np.dtype(
    (
        np.record,
        [
            ('samples', np.int64),
            ('t_first', np.float64),
            ('t', np.float64),
            ('t_raw', np.float64),  # last sample seen, accepted or thinned out
            ('t_test', np.float64),  # no test before
            ('t_stem', np.float64),  # no test of r1 before
            ('filled', np.int64),  # pressure samples since the last restart
            ('past', np.float64, (2, TAPS)),
            ('p_hat', np.float64, (2,)),
            ('steady', np.int64),  # samples in a row at the period
            ('innovation', np.float64, (2,)),  # of P1, P2; NaN until as many as taps are steady
            ('stem', STEM, (2,)),  # nominal, wide play
            ('fault', FAULTS, (2,)),
            ('cv', np.float64, (4,)),
            ('dp', np.float64, (2,)),  # z(k), z(k-1)
            ('xm', np.float64, (3,)),
            ('xd', np.float64),
            ('phi', np.float64, (N_WEIGHTS,)),
            ('f', np.float64),
            ('sq', np.float64),
            ('masked', np.bool_),
            ('residual', np.float64, (5,)),
            ('g', np.float64, (N_TESTS, 2)),
            ('zero', np.float64, (N_TESTS, 2)),  # when g was last zero: estimate of the onset
            ('llr', np.float64),
            ('llr_zero', np.float64),
            ('ratio', np.float64),  # largest statistic / limit
            ('worst', np.int64),
            ('alarm', np.bool_),
            ('t_alarm', np.float64),
            ('t_onset', np.float64),
            ('test', np.int64),
            ('ratios', np.float64, (N_TESTS + 1,)),
            ('peaks', np.float64, (N_TESTS + 1,)),  # largest of the ratios so far
            ('history', HISTORY, (HISTORY_LENGTH,)),
        ],
    )
)
