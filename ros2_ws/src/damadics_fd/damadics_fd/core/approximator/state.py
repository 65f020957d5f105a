# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the approximator remembers between samples, and the estimate it makes of each."""

from dataclasses import dataclass
from typing import Annotated

from damadics_fd.core.record import Floats, Record

TERMS = 5  # in each regressor of (15)
FORCE = 3  # offset, relative change of the stiffness, friction / (K L)
SUMS = 11  # weight, upper triangle of S, q, square of the left side


class Network(Record):
    """Weights and regressors of (15)."""

    w1: Annotated[Floats, TERMS]
    w2: Annotated[Floats, TERMS]
    eps1: float
    b1: float
    S1: Annotated[Floats, TERMS]
    S2: Annotated[Floats, TERMS]


class Observer(Network):
    """Observer (10), (11) with its errors, Phi and the alphas."""

    xh1: float
    xh2: float
    xi1: float
    xi2: float
    phi: float
    ah1: float
    ah4: float
    ah5: float


class Velocity(Record):
    """Filters of position, velocity and input."""

    y: float
    v: float
    y_raw: float
    y_lag: float
    u_raw: float
    uy: float
    uv: float
    dt: float
    gain: float
    gain_v: float
    lag: float
    x1: float
    x2: float
    u: float


class Transmitter(Record):
    """Signals delayed as the transmitter of the chamber pressure delays its own."""

    late_x1: float
    late_p1: float
    late_p2: float


class Guard(Record):
    """The force balance in blocks of the learning time; what every sample needs comes last."""

    block: Annotated[Floats, SUMS]
    base: Annotated[Floats, SUMS]
    pool: Annotated[Floats, SUMS]
    block_end: int
    proven: float
    unsettled: int
    distance: float
    change: Annotated[Floats, FORCE]
    theta: Annotated[Floats, FORCE]
    cov: Annotated[Floats, FORCE, FORCE]
    sigma: float
    drift: float
    elapsed: int  # ns since the first sample, gaps that restart the filters left out
    place: float
    direction: float
    moved: int
    travel: float


class State(Guard, Velocity, Observer, Transmitter):
    """All of it, with the phases of learning."""

    start: int  # elapsed time at which learning began
    held_until: int  # elapsed time at which the filters have settled after a restart
    armed: bool
    phase: int
    trend: float
    noise: float
    rest: float
    rested: int
    exceeded: int  # elapsed time at which an alarm would last have been near


LEARNED = ('ah1', 'ah4', 'ah5', 'w1', 'w2', 'eps1', 'b1', 'base', 'theta', 'cov', 'sigma')


@dataclass
class Estimate(Record):
    """Hold one result of the estimator, with the fields of damadics_msgs/Estimate."""

    stamp: int  # ns
    x2: float
    x1_hat: float
    x2_hat: float
    xi1: float
    xi2: float
    phi: float
    alpha1: float
    alpha4: float
    alpha5: float
    x1: float
    u: float
    ps: float
    dp: float
    progress: float
    phase: int

    @property
    def alpha_hat(self) -> tuple[float, float, float]:
        """
        Return the estimates of alpha1, alpha4, alpha5.

        :return: [1/s, 1/s2, 1/s2].
        """
        return self.alpha1, self.alpha4, self.alpha5
