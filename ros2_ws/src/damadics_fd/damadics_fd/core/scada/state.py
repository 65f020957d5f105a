# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the SCADA-rate monitor keeps: the learned reference, the state, the last samples."""

import numpy as np

from damadics_fd.core.scada.cusum import TESTS
from damadics_fd.core.scada.model import FAULTS, STEM
from damadics_fd.core.scada.flow_law import FLOW_LAW
from damadics_fd.core.scada.pressure import PRESSURE, TAPS
from damadics_fd.core.scada.stem_law import STEM_LAW, STEM_TRACK

N_TESTS = len(TESTS)
N_WEIGHTS = 11
BASIC_WEIGHTS = 3  # constant, gain, CV slope; the others only where they earn their place
HISTORY_LENGTH = 1536
N_RESIDUALS = 6
NOMINAL, LAW = range(2)  # where stem and flow come from: the stated actuator, what was identified

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
            ('stem_kind', np.int64),  # NOMINAL or LAW
            ('flow_kind', np.int64),
            ('stem_law', STEM_LAW),
            ('flow_law', FLOW_LAW),
            ('period', np.float64),  # of the samples learned from, s
            ('signals', np.int64),  # bit i: signal i of the samples was measured
            ('low', np.float64, (7,)),  # learned range of each signal
            ('high', np.float64, (7,)),
            ('seconds', np.float64),  # how long the record was
            ('drop', np.float64),  # P1 - P2
            ('flow_max', np.float64),
            ('swing', np.float64, (2,)),  # change of P1, P2 that no load change explains
            ('x_mean', np.float64),  # of the model, where r1 was learned
            ('x_sd', np.float64),
            ('f_mean', np.float64),  # of the flow, where r2 was learned
            ('f_sd', np.float64),
            ('se', np.float64, (N_TESTS,)),  # allowance that grows with the distance from there
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
            ('track', STEM_TRACK),
            ('xs', np.float64),  # slow copy of the stem law
            ('last', np.float64, (5,)),  # CV, X, P1, P2, F of the sample before
            ('repeats', np.int64),  # samples in a row that are the one before
            ('size', np.float64),
            ('f_lagged', np.float64),
            ('flat', np.int64),  # samples in a row with the same flow
            ('last_flow', np.float64),
            ('level', np.float64, (2,)),  # where P1, P2 have been lately
            ('level_before', np.float64, (2,)),  # the same before the present occurrence
            ('level_flow', np.float64),
            ('t_stop', np.float64),  # the stem was at an end until then
            ('testable', np.uint8, (N_RESIDUALS,)),
            ('stands', np.uint8, (N_RESIDUALS,)),  # a fault seen in it and not seen to be gone
            ('good', np.int64, (N_RESIDUALS,)),  # testable samples in a row without evidence
            ('travel', np.float64),  # of the model since the last evidence in r1
            ('lever', np.float64, (2,)),
            ('saved', np.float64, (N_TESTS, 2)),  # statistics before a jump that may be a spike
            ('jumped', np.uint8, (N_RESIDUALS,)),
            ('spikes', np.int64, (N_RESIDUALS,)),
            ('doubtful', np.uint8, (2,)),  # the last P1, P2 was not believed
            ('occurrence', np.int64),
            ('t_raised', np.float64),  # of the present occurrence; t_alarm is the first one's
            ('stood', np.bool_),
            ('recovery', np.int64),  # samples without evidence after which a fault has gone
            ('t_gone', np.float64),
            ('t_shown', np.float64, (N_RESIDUALS,)),  # when each residual showed it first; NaN: not yet
            ('sign', np.float64, (N_RESIDUALS,)),  # and which way
            ('t_evidence', np.float64),  # last sample with evidence of it
            ('fault', FAULTS, (2,)),
            ('cv', np.float64, (4,)),
            ('dp', np.float64, (2,)),  # z(k), z(k-1)
            ('xm', np.float64, (3,)),
            ('xd', np.float64),
            ('phi', np.float64, (N_WEIGHTS,)),
            ('f', np.float64),
            ('f_model', np.float64),  # the same with the model's position
            ('sq', np.float64),
            ('masked', np.bool_),
            ('residual', np.float64, (N_RESIDUALS,)),
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
            ('beyond', np.uint8, (N_TESTS,)),  # this sample speaks for a fault
            ('ratios', np.float64, (N_TESTS + 1,)),
            ('peaks', np.float64, (N_TESTS + 1,)),  # largest of the ratios so far
            ('history', HISTORY, (HISTORY_LENGTH,)),
        ],
    )
)
