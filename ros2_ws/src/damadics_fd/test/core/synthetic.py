# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A valve computed backwards: the stem moves as told, its pressure from the force balance."""

import numpy as np
from damadics_fd.core.valve.plug import RECOVERY, recoveries

KL = 60892.0 * 0.0381


def valve(
    seconds=120.0,
    rate=200.0,
    friction=0.011,
    stiffness=1.0,
    noise=0.0,
    seed=0,
    motion=None,
    stamps=None,
    first=0.0,
):
    """
    Return columns of a valve with Coulomb and viscous friction and no mass.

    :param friction: dry friction / (K L), a number or a function of time [s].
    :param stiffness: factor on K, a number or a function of time.
    :param motion: position as a function of time; by default a triangle of 10 s, 0.2 .. 0.8.
    """
    t = first + np.arange(round(seconds * rate)) / rate if stamps is None else stamps
    x = (motion or (lambda s: 0.2 + 0.12 * np.abs((s % 10.0) - 5.0)))(t)
    v = np.gradient(x, t)
    f = friction(t) if callable(friction) else friction
    k = stiffness(t) if callable(stiffness) else stiffness
    p1, p2 = 3.5e6 + 1.75e5 * np.sin(0.2 * np.pi * t), np.full(len(t), 2.6e6)
    plug = (p1 - p2) * np.pi * 0.05**2 / 4 / recoveries(RECOVERY, x)
    u = k * (x + 0.25) + 750.0 / 30446.0 * v + f * np.tanh(v / 0.002)
    rng = np.random.default_rng(seed)
    return {
        'stamp': np.round(t * 1e9).astype(np.int64),
        'cv': np.clip(x, 0, 1),
        'x1': x + noise * rng.standard_normal(len(t)),
        'p1': p1,
        'p2': p2,
        't1': np.full(len(t), 20.0),
        'flow': np.full(len(t), 8.0),
        'ps': (u * KL - 2 * 9.81 + plug) / 0.029,
    }
