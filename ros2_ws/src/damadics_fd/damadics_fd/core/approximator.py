# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The on-line approximator: observer (10), (11) and adaptive laws, step by step."""

from typing import Any

from damadics_fd.core import honn
from damadics_fd.core.jit import jit

STATE = [('xh1', 'f8'), ('xh2', 'f8'), ('xi1', 'f8'), ('xi2', 'f8'), ('phi', 'f8'),
         ('ah1', 'f8'), ('ah4', 'f8'), ('ah5', 'f8'), *honn.STATE]


@jit
def begin(s: Any, c: Any) -> None:
    """
    Forget what was learned.

    :param s: state record.
    :param c: settings record with the initial alphas.
    """
    s.ah1 = c.alpha1
    s.ah4 = c.alpha4
    s.ah5 = c.alpha5
    s.w1[:] = 0.0
    s.w2[:] = 0.0
    s.eps1 = 0.0
    s.b1 = 0.0


@jit
def restart(s: Any, x1: float) -> None:
    """
    Put the observer on a position at rest; what is learned stays.

    :param s: state record.
    :param x1: position [1].
    """
    s.xh1 = x1
    s.xh2 = 0.0
    s.xi1 = 0.0
    s.xi2 = 0.0


@jit
def observe(s: Any, c: Any, dt: float, x1: float, x2: float, u: float) -> None:
    """
    Advance the observer (10), (11) by backward Euler in closed form: stable at any dt.

    :param s: state record: xh1, xh2 in and out; xi1, xi2 [1/s], phi = Phi [1/s2] out.
    :param c: settings record.
    :param dt: time step [s].
    :param x1: position [1].
    :param x2: velocity [1/s].
    :param u: input [1].
    """
    honn.regress(s, x2)
    s.phi = honn.bound(s, x2)
    P = abs(s.phi)
    den = 1.0 + dt * (s.ah1 + c.k2)
    R = x2 - s.xh2 + dt * (s.ah1 * x2 + s.ah5 * x1 - s.ah4 * u)
    A = x1 - s.xh1 - dt * x2
    pull = 0.0  # (ah5/p) of the coupling in (10)
    if c.coupling > 0.0:
        pull = s.ah5 / c.coupling
        den += dt * dt * s.ah5 * pull / (1.0 + dt * c.k1)
        R -= dt * s.ah5 * A / (1.0 + dt * c.k1)
    xi2 = R / (den + dt * P / c.delta)  # sigm(xi2) = xi2/delta inside the boundary layer
    if abs(xi2) > c.delta:
        xi2 = (R - dt * P) / den if R > 0.0 else (R + dt * P) / den
    s.xi2 = xi2
    s.xi1 = (A + dt * pull * xi2) / (1.0 + dt * c.k1)
    s.xh1 = x1 - s.xi1
    s.xh2 = x2 - xi2


@jit
def observe_printed(s: Any, c: Any, dt: float, x1_0: float, x2_0: float, u_0: float, x1: float,
                    x2: float, u: float) -> None:
    """
    Advance the observer (10), (11) by one Runge-Kutta step, as the printed method was simulated.

    Inputs and Phi run on straight lines from the sample before to this one. The error xi2 is
    therefore that before the observer has answered to the new sample; the implicit step of
    `observe` halves it, which delays the decision on the friction fault by one sample.

    :param s: state record as in `observe`; phi is that of the sample before on entry.
    :param c: settings record.
    :param dt: time step [s]; k2 dt must stay below 2.7.
    :param x1_0: position at the sample before [1].
    :param x2_0: velocity there [1/s].
    :param u_0: input there [1].
    :param x1: position [1].
    :param x2: velocity [1/s].
    :param u: input [1].
    """
    phi_0 = honn.bound(s, x2_0)  # with the regressors of then and the weights of now
    honn.regress(s, x2)
    s.phi = honn.bound(s, x2)
    pull = s.ah5 / c.coupling if c.coupling > 0.0 else 0.0
    slope1, slope2, sum1, sum2 = 0.0, 0.0, 0.0, 0.0
    for stage in range(4):
        part = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        weight = 1.0 if stage == 0 or stage == 3 else 2.0
        xh1 = s.xh1 + part * dt * slope1
        xh2 = s.xh2 + part * dt * slope2
        xi1 = x1_0 + part * (x1 - x1_0) - xh1
        xi2 = x2_0 + part * (x2 - x2_0) - xh2
        phi = phi_0 + part * (s.phi - phi_0)
        slope1 = x2_0 + part * (x2 - x2_0) + c.k1 * xi1 - pull * xi2
        slope2 = (-s.ah1 * xh2 - s.ah5 * xh1 + s.ah4 * (u_0 + part * (u - u_0)) + c.k2 * xi2
                  + phi * min(max(xi2 / c.delta, -1.0), 1.0))
        sum1 += weight * slope1
        sum2 += weight * slope2
    s.xh1 += dt / 6.0 * sum1
    s.xh2 += dt / 6.0 * sum2
    s.xi1 = x1 - s.xh1
    s.xi2 = x2 - s.xh2


@jit
def clip(value: float, nominal: float, band: float) -> float:
    """
    Project an alpha on nominal (1 +- band).

    :param value: the estimate.
    :param nominal: its initial value.
    :param band: half width as a share of it.
    :return: the projected estimate.
    """
    return min(max(value, nominal * (1.0 - band)), nominal * (1.0 + band))


@jit
def adapt_alpha(s: Any, c: Any, dt: float, x1: float, u: float) -> None:
    """
    Adapt the alphas by one step of their laws below (11), within their projection band.

    :param s: state record after `observe`.
    :param c: settings record.
    :param dt: time step [s].
    :param x1: position [1].
    :param u: input [1].
    """
    s.ah1 = clip(s.ah1 - dt * c.g1 * s.xh2 * s.xi2, c.alpha1, c.band)
    s.ah4 = clip(s.ah4 + dt * c.g4 * u * s.xi2, c.alpha4, c.band)
    s.ah5 = clip(s.ah5 - dt * c.g5 * x1 * s.xi2, c.alpha5, c.band)


@jit
def adapt_phi(s: Any, c: Any, dt: float, x2: float) -> None:
    """
    Adapt the weights and bounds in Phi by one step of their laws, outside the dead-zone only.

    :param s: state record after `observe`.
    :param c: settings record.
    :param dt: time step [s].
    :param x2: velocity [1/s].
    """
    over = abs(s.xi2) - c.dz
    if over > 0.0:
        honn.learn(s, x2, dt * c.gw * over, c.w_max)
