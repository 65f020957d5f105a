# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Delay the other signals as the damped transmitter of the chamber pressure delays its own."""

import math

import numpy as np

from damadics_fd.core.approximator.state import Transmitter
from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats
from damadics_fd.core.settings import Settings


@jit
def delay(
    s: Transmitter, c: Settings, afresh: bool, dt: float, x1: float, p1: float, p2: float
) -> tuple[float, float, float]:
    """
    Pass position and process pressures through the first-order lag of `ps`.

    A force balance of signals of different age shows friction that is not there: K v T of it.

    :param s: state record: late_x1, late_p1, late_p2 in and out.
    :param c: settings record with ps_lag [s].
    :param afresh: start the lags on this sample.
    :param dt: time since the last sample [s].
    :param x1: position [1].
    :param p1: pressure before the valve [Pa].
    :param p2: pressure behind the valve [Pa].
    :return: the three as late as ps.
    """
    share = 1.0 if afresh else -math.expm1(-dt / c.ps_lag)
    s.late_x1 += share * (x1 - s.late_x1)
    s.late_p1 += share * (p1 - s.late_p1)
    s.late_p2 += share * (p2 - s.late_p2)
    return s.late_x1, s.late_p1, s.late_p2


@jit
def delay_column(values: Floats, steps: Floats, lag: float) -> Floats:
    """
    Pass a column through the first-order lag, as `delay` does sample by sample.

    :param values: of one signal.
    :param steps: time since the sample before [s]; infinite where the lag starts afresh.
    :param lag: [s].
    :return: the delayed column.
    """
    late = np.empty(len(values))
    held = values[0]
    for i in range(len(values)):
        held += -math.expm1(-steps[i] / lag) * (values[i] - held)
        late[i] = held
    return late
