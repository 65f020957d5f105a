# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recording given to the signature alone, sample by sample."""

import numpy as np
from damadics_fd.core.jit import jit
from damadics_fd.core.signature.signature import Signature
from damadics_fd.core.signature.step import step


@jit
def _feed(s, c, stamp, x, ps, dp, alarm, results):
    for i in range(len(stamp)):
        results[i] = step(s[0], c[0], stamp[i], x[i], ps[i], dp[i], True, alarm[i])


def feed(signature: Signature, stamp, x, ps, dp, alarm_at=np.inf) -> np.ndarray:
    """Return what the step told of each sample; there is an alarm from `alarm_at` [s] on."""
    stamp, x, ps, dp = (np.ascontiguousarray(column) for column in (stamp, x, ps, dp))
    results = np.zeros(len(stamp), np.int64)
    alarm = stamp * 1e-9 >= alarm_at
    _feed(signature.state, signature.record, stamp, x, ps, dp, alarm, results)
    return results
