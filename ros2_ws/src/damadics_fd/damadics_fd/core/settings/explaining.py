# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the valve signature: what changed, by how much, what is worth a word."""

from dataclasses import dataclass

from damadics_fd.core.field import Section, number, switch

MONITOR = ('monitor',)


@dataclass(frozen=True, eq=False, repr=False)
class Explaining(Section):
    """Tune the valve signature, which needs ps and tells friction, spring and sensors apart."""

    signature: bool = switch(
        'tell friction, spring and sensors apart; needs ps', True, paper=False, modes=MONITOR
    )
    own_alarm: bool = switch(
        'alarm on changes that the approximator cannot see', True, paper=False, modes=MONITOR
    )
    verify: float = number(
        's',
        'time to check the force model after learning; half an hour on a real valve',
        0.0,
        1e6,
        60.0,
        modes=MONITOR,
    )
    plug_gain_std: float = number(
        '',
        'how well the plug force is known: standard deviation of its gain',
        1e-9,
        1.0,
        0.03,
        modes=MONITOR,
    )
    plug_shape_std: float = number(
        '', 'and of each entry of its table', 1e-9, 1.0, 0.01, modes=MONITOR
    )
    material_friction: float = number(
        '', 'change of friction that asks for maintenance', 0.0, 100.0, 0.3, modes=MONITOR
    )
    material_spring: float = number(
        '', 'change of stiffness that asks for maintenance', 0.0, 1.0, 0.02, modes=MONITOR
    )
    material_supply: float = number(
        '',
        'loss of supply pressure that alarms, as a share; a slow one is 1.7 times as large',
        0.01,
        0.9,
        0.14,
        modes=MONITOR,
    )
