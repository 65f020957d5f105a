# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the on-line approximator: velocity, observer, adaptive laws, threshold."""

from dataclasses import dataclass
from typing import ClassVar

from damadics_fd.core.field import APPROXIMATOR, Section, choice, number, switch

VELOCITIES = ('high_pass', 'kalman', 'super_twisting')
THRESHOLDS = ('paper', 'floor')


@dataclass(frozen=True, eq=False, repr=False)
class Approximation(Section):
    """Tune equations (10)-(16) and the velocity they work on."""

    DERIVED: ClassVar[tuple[str, ...]] = ('velocity_code', 'threshold_code')

    # velocity estimator
    velocity: str = choice(
        'velocity estimator', VELOCITIES, 'kalman', paper='high_pass', modes=APPROXIMATOR
    )
    tau: float = number(
        's',
        'time constant of the high-pass velocity filter',
        1e-4,
        10.0,
        0.02,
        paper=0.14,
        modes=APPROXIMATOR,
    )
    wn: float = number(
        'rad/s',
        'bandwidth of the steady-state Kalman filter',
        0.1,
        1e4,
        50.0,
        modes=APPROXIMATOR,
    )
    lipschitz: float = number(
        '1/s2',
        'bound on the acceleration / stroke for the super-twisting differentiator',
        1e-3,
        1e6,
        20.0,
        modes=APPROXIMATOR,
    )
    consistent: bool = switch(
        'filter position and input with the filter of the velocity',
        True,
        paper=False,
        modes=APPROXIMATOR,
    )

    # observer and adaptive laws, equations (10)-(15)
    k1: float = number(
        '1/s', 'observer gain on the position error', 1e-3, 1e6, 100.0, modes=APPROXIMATOR
    )
    k2: float = number(
        '1/s', 'observer gain on the velocity error', 1e-3, 1e6, 400.0, modes=APPROXIMATOR
    )
    coupling: float = number(
        '',
        'weight p of xi1 in the Lyapunov function; the term '
        'alpha5/p xi2 in (10) is left out where p is 0',
        0.0,
        1e9,
        0.0,
        paper=1.0,
        modes=APPROXIMATOR,
    )
    alpha1: float = number(
        '1/s',
        'initial alpha1, viscous friction / mass',
        0.0,
        1e7,
        750.0,
        paper=0.0,
        modes=APPROXIMATOR,
    )
    alpha4: float = number(
        '1/s2', 'initial alpha4, input gain', 0.0, 1e9, 30446.0, paper=0.04, modes=APPROXIMATOR
    )
    alpha5: float = number(
        '1/s2',
        'initial alpha5, stiffness / mass',
        0.0,
        1e9,
        30446.0,
        paper=0.04,
        modes=APPROXIMATOR,
    )
    g1: float = number('', 'adaptation gain of alpha1', 0.0, 1e9, 0.0, modes=APPROXIMATOR)
    g4: float = number('', 'adaptation gain of alpha4', 0.0, 1e9, 0.0, modes=APPROXIMATOR)
    g5: float = number(
        '', 'adaptation gain of alpha5', 0.0, 1e9, 1000.0, paper=0.0, modes=APPROXIMATOR
    )
    gw: float = number(
        '',
        'adaptation gain of the weights and bounds in Phi',
        0.0,
        1e9,
        500.0,
        paper=100.0,
        modes=APPROXIMATOR,
    )
    delta: float = number(
        '1/s',
        'half width of the boundary layer of the robust term',
        1e-9,
        1e3,
        0.03,
        paper=0.05,
        modes=APPROXIMATOR,
    )
    dz: float = number(
        '1/s',
        'dead-zone: Phi learns only where |xi2| is larger',
        0.0,
        1e3,
        0.06,
        paper=0.0,
        modes=APPROXIMATOR,
    )
    band: float = number(
        '',
        'alphas stay within this share of their initial values',
        0.0,
        1.0,
        0.3,
        modes=APPROXIMATOR,
    )
    w_max: float = number(
        '', 'bound on the norm of the weights in Phi', 1e-9, 1e12, 1e5, modes=APPROXIMATOR
    )

    # threshold (16)
    threshold: str = choice(
        'paper: rho = |Phi|/k2; floor: kappa |Phi|/(k2 + alpha1)',
        THRESHOLDS,
        'floor',
        paper='paper',
        modes=APPROXIMATOR,
    )
    kappa: float = number(
        '', 'factor of the threshold "floor"', 0.01, 1e3, 1.5, paper=1.0, modes=APPROXIMATOR
    )
    rho_min: float = number('1/s', 'lowest threshold', 0.0, 1e3, 0.2, paper=0.0, scada=1.0)

    @property
    def velocity_code(self) -> int:
        """Place of the velocity estimator in `VELOCITIES`."""
        return VELOCITIES.index(self.velocity)

    @property
    def threshold_code(self) -> int:
        """Place of the threshold in `THRESHOLDS`."""
        return THRESHOLDS.index(self.threshold)
