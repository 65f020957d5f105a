# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The on-line approximator: observer (10), (11) and adaptive laws, step by step."""

from damadics_fd.core.approximator import network
from damadics_fd.core.approximator.state import Observer
from damadics_fd.core.jit import jit, layer
from damadics_fd.core.settings import Settings

STIFFEST = 2.5  # largest rate times step; Runge and Kutta's method is unstable from 2.78 on
SHORTEST = 1e-9  # s


@jit
def begin(s: Observer, c: Settings) -> None:
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
def restart(s: Observer, x1: float) -> None:
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
def observe(
    s: Observer,
    c: Settings,
    dt: float,
    terms: tuple[float, float, float],
    x1: float,
    x2: float,
    u: float,
) -> None:
    """
    Advance the observer (10), (11) by backward Euler in closed form: stable at any dt.

    :param s: state record: xh1, xh2 in and out; xi1, xi2 [1/s], phi = Phi [1/s2] out.
    :param c: settings record.
    :param dt: time step [s].
    :param terms: what `network.sigmoids` returns for x2.
    :param x1: position [1].
    :param x2: velocity [1/s].
    :param u: input [1].
    """
    network.regress(s, terms)
    s.phi = network.bound(s, x2)
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
def slopes(
    s: Observer,
    c: Settings,
    pull: float,
    gain: float,
    phi: float,
    x1: float,
    x2: float,
    u: float,
    xi1: float,
    xi2: float,
) -> tuple[float, float]:
    """
    Return the right sides of (10) and (11).

    :param s: state record with the alphas.
    :param c: settings record.
    :param pull: ah5/p of the coupling in (10), 0 for none.
    :param gain: slope of Phi sigm(xi2) in the boundary layer [1/s].
    :param phi: Phi of (15) [1/s2].
    :param x1: position [1].
    :param x2: velocity [1/s].
    :param u: input [1].
    :param xi1: error x1 - xh1 [1].
    :param xi2: error x2 - xh2 [1/s].
    :return: derivatives of xh1 [1/s] and xh2 [1/s2].
    """
    robust = min(max(gain * xi2, -abs(phi)), abs(phi))  # Phi sigm(xi2)
    known = s.ah4 * u - s.ah5 * x1 - s.ah1 * x2
    return (x2 + c.k1 * xi1 - pull * xi2, known + s.ah5 * xi1 + (s.ah1 + c.k2) * xi2 + robust)


@layer
def observe_printed(
    s: Observer,
    c: Settings,
    dt: float,
    terms: tuple[float, float, float],
    x1_0: float,
    x2_0: float,
    u_0: float,
    x1: float,
    x2: float,
    u: float,
) -> None:
    """
    Advance the observer (10), (11) by one Runge-Kutta step, as the printed method was simulated.

    Inputs and Phi run on straight lines from the sample before to this one. The error xi2 is
    therefore that before the observer has answered to the new sample; the implicit step of
    `observe` halves it, which delays the decision on the friction fault by one sample.
    Where Phi has drifted so far that the step cannot resolve the boundary layer, it is widened.

    :param s: state record as in `observe`; phi is that of the sample before on entry.
    :param c: settings record.
    :param dt: time step [s]; k2 dt must stay below 2.5.
    :param terms: what `network.sigmoids` returns for x2.
    :param x1_0: position at the sample before [1].
    :param x2_0: velocity there [1/s].
    :param u_0: input there [1].
    :param x1: position [1].
    :param x2: velocity [1/s].
    :param u: input [1].
    """
    phi_0 = network.bound(s, x2_0)  # with the regressors of then and the weights of now
    network.regress(s, terms)
    s.phi = network.bound(s, x2)
    pull = s.ah5 / c.coupling if c.coupling > 0.0 else 0.0
    half, steep = 0.5 * dt, 1.0 / c.delta
    room = max(STIFFEST / max(dt, SHORTEST) - c.k2 - s.ah1, 0.0)
    x1_m, x2_m = 0.5 * (x1_0 + x1), 0.5 * (x2_0 + x2)
    u_m, phi_m = 0.5 * (u_0 + u), 0.5 * (phi_0 + s.phi)
    g_0, g_m, g_1 = (
        min(max(steep * phi_0, -room), room),
        min(max(steep * phi_m, -room), room),
        min(max(steep * s.phi, -room), room),
    )
    xh1, xh2 = s.xh1, s.xh2
    e1, e2 = x1_m - xh1, x2_m - xh2
    p1, p2 = slopes(s, c, pull, g_0, phi_0, x1_0, x2_0, u_0, x1_0 - xh1, x2_0 - xh2)
    q1, q2 = slopes(s, c, pull, g_m, phi_m, x1_m, x2_m, u_m, e1 - half * p1, e2 - half * p2)
    r1, r2 = slopes(s, c, pull, g_m, phi_m, x1_m, x2_m, u_m, e1 - half * q1, e2 - half * q2)
    v1, v2 = slopes(s, c, pull, g_1, s.phi, x1, x2, u, x1 - xh1 - dt * r1, x2 - xh2 - dt * r2)
    s.xh1 = xh1 + dt / 6.0 * (p1 + 2.0 * (q1 + r1) + v1)
    s.xh2 = xh2 + dt / 6.0 * (p2 + 2.0 * (q2 + r2) + v2)
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
def adapt_alpha(s: Observer, c: Settings, dt: float, x1: float, u: float) -> None:
    """
    Adapt the alphas by one step of their laws below (11), within their projection band.

    :param s: state record after `observe`.
    :param c: settings record.
    :param dt: time step [s].
    :param x1: position [1].
    :param u: input [1].
    """
    if c.g1 == 0.0 and c.g4 == 0.0 and c.g5 == 0.0:
        return
    s.ah1 = clip(s.ah1 - dt * c.g1 * s.xh2 * s.xi2, c.alpha1, c.band)
    s.ah4 = clip(s.ah4 + dt * c.g4 * u * s.xi2, c.alpha4, c.band)
    s.ah5 = clip(s.ah5 - dt * c.g5 * x1 * s.xi2, c.alpha5, c.band)


@layer
def adapt_phi(s: Observer, c: Settings, dt: float, x2: float) -> None:
    """
    Adapt the weights and bounds in Phi by one step of their laws, outside the dead-zone only.

    :param s: state record after `observe`.
    :param c: settings record.
    :param dt: time step [s].
    :param x2: velocity [1/s].
    """
    over = abs(s.xi2) - c.dz
    if over > 0.0:
        network.learn(s, x2, dt * c.gw * over, c.w_max)
