# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the learning time, in which the valve counts as fault-free."""

from dataclasses import dataclass

from damadics_fd.core.field import APPROXIMATOR, Section, number

LEARNING = ('monitor', 'scada')
MONITOR = ('monitor',)


@dataclass(frozen=True, eq=False, repr=False)
class LearningTime(Section):
    """Tune how long is learned and what the valve has to show meanwhile."""

    t_on: float = number(
        's',
        'time for the filters to settle before learning',
        0.0,
        1e6,
        5.0,
        paper=0.0,
        scada=300.0,
        modes=LEARNING,
    )
    t_w: float = number(
        's',
        'start of the learning of Phi',
        0.0,
        1e6,
        20.0,
        paper=0.0,
        scada=60.0,
        modes=LEARNING,
    )
    t_learn: float = number(
        's', 'earliest end of learning', 0.0, 1e7, 60.0, paper=0.0, scada=900.0, modes=LEARNING
    )
    travel_min: float = number(
        '',
        'stem travel / stroke that learning needs',
        0.0,
        1e6,
        0.5,
        paper=0.0,
        modes=MONITOR,
    )
    noise_factor: float = number(
        '',
        'standard deviations of the noise, where it is largest, that '
        'Phi and threshold together keep off at least',
        0.0,
        100.0,
        5.0,
        modes=MONITOR,
    )
    play: float = number(
        '',
        'motion within a play of this half width is no travel',
        0.0,
        0.5,
        0.005,
        modes=APPROXIMATOR,
    )
    settled_stiffness: float = number(
        '',
        'change of the stiffness while learning that is tolerated',
        1e-6,
        1.0,
        0.004,
        modes=MONITOR,
    )
    settled_friction: float = number(
        '',
        'change of the friction / (K L) while learning that is tolerated',
        1e-6,
        1.0,
        0.0018,
        modes=MONITOR,
    )
    settled_max: float = number(
        '',
        'squared distance, in standard deviations, from the valve at '
        'the start of learning that makes it start again',
        1.0,
        1e12,
        60.0,
        modes=MONITOR,
    )
