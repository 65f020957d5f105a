# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The constants of the approximator for a valve, by the rules for another actuator."""

from damadics_fd.commands.commission.forces.balance import Balance
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.monitor import Chain
from damadics_fd.core.result import Columns
from damadics_fd.core.settings import Settings

BANDWIDTHS = (50.0, 25.0)  # rad/s, tried from the fast one on until the noise is low enough


def tune(columns: Columns, balance: Balance, base: Settings) -> tuple[Settings, float, list[str]]:
    """
    Set the constants by the rules for another actuator.

    a4 = a5 = K/m, a1 = s2/m; Phi is expected about 1.4 Fc/(m L); delta = 0.075 Phi/(k2 + a1);
    dz = 2 delta and at least four standard deviations of the noise; rho_min = 3.3 dz;
    gw = 33 (k2 + a1)/(1.93 T); g5 = 0.87 (k2 + a1).

    :param columns: the recording.
    :param balance: the force balance.
    :param base: its settings, whatever is to be switched off switched off.
    :return: settings, noise of xi2 [1/s], remarks.
    """
    remarks = []
    alpha1, alpha5 = balance.viscous / base.mass, base.stiffness / base.mass
    pole = base.k2 + alpha1
    phi = 1.4 * max(balance.friction, 0.5 * balance.total) / (base.mass * base.stroke)
    delta = _digits(max(0.075 * phi / pole, 1e-4))
    scaled = base.replace(
        alpha1=_digits(alpha1),
        alpha4=_digits(alpha5, 5),
        alpha5=_digits(alpha5, 5),
        delta=delta,
        dz=2.0 * delta,
        rho_min=_digits(6.6 * delta),
        g5=_digits(0.87 * pole),
        gw=_digits(33.0 * pole / (1.93 * (base.t_learn - base.t_w))),
    )
    # the noise that is followed is times the plug coefficient, which a balanced trim has above 1
    weight = max(scaled.plug_table[0], 1.0)
    for wn in BANDWIDTHS:
        scaled = scaled.replace(wn=wn)
        estimator = Estimator(scaled)
        Chain(scaled, estimator=estimator).run(columns)
        state = estimator.state[0]
        noise = 1.4826 * float(state.noise) / (pole * weight)
        if 4.0 * noise <= scaled.dz:
            break
    if 4.0 * noise > scaled.dz:
        remarks.append(
            f'sensor noise is {noise:.2g} 1/s in the residual: the dead-zone is '
            'widened, small faults take longer to show; damp the pressure '
            'transmitters or calibrate their span to what is needed'
        )
        dz = _digits(4.0 * noise)
        scaled = scaled.replace(dz=dz, rho_min=_digits(3.3 * dz))
    share = 4.0 * balance.stiffness_std / base.stiffness
    if share > 0.02:
        remarks.append(f'stiffness is known to {100.0 * share:.1f} % only: record more motion')
    return scaled, noise, remarks


def _digits(value: float, digits: int = 3) -> float:
    return float(f'{value:.{digits}g}')
