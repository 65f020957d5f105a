# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The adaptive threshold rho on the residual |xi2|, equation (16)."""

from damadics_fd.core.jit import jit
from damadics_fd.core.settings import Settings

PAPER_RHO, FLOOR_RHO = range(2)


@jit
def threshold(c: Settings, phi: float, ah1: float) -> float:
    """
    Return the threshold for a learned bound.

    (16) drops alpha1 from the comparison |xi2| <= |Phi|/(k2 + alpha1) and so is 2.9 times
    larger than need be for the benchmark valve; "floor" keeps it, with a factor of safety.

    :param c: settings record.
    :param phi: Phi of (15) [1/s2].
    :param ah1: estimate of alpha1 [1/s].
    :return: rho [1/s].
    """
    if c.threshold_code == PAPER_RHO:
        return max(abs(phi) / c.k2, c.rho_min)
    return max(c.kappa * abs(phi) / (c.k2 + ah1), c.rho_min)
