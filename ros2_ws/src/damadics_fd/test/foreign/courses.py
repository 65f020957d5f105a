# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the control value of a foreign valve moves."""

import numpy as np


def steps(seconds, seed, low=0.0, high=1.0, least=4.0, most=14.0, period=0.005):
    """Return a command of random steps."""
    rng = np.random.default_rng([seed, 3])
    u, n = np.empty(round(seconds / period)), 0
    while n < len(u):
        m = n + round(rng.uniform(least, most) / period)
        u[n:m] = rng.uniform(low, high)
        n = m
    return u


def control(seconds, seed, centre=0.5, amplitude=0.01, period=0.005):
    """Return the command of a loop at work: small wandering steps each second."""
    rng = np.random.default_rng([seed, 5])
    m = int(seconds) + 2
    walk = np.zeros(m)
    for i in range(1, m):
        walk[i] = 0.9 * walk[i - 1] + rng.standard_normal() * amplitude
    return np.repeat(np.clip(centre + walk, 0.02, 0.98), round(1 / period))[
        : round(seconds / period)
    ]


def batch(seconds, seed, rest=300.0, period=0.005):
    """Return a command of full strokes with long rests between."""
    rng = np.random.default_rng([seed, 7])
    u, n, level = np.empty(round(seconds / period)), 0, 0.1
    while n < len(u):
        level = 0.9 - level if rng.random() < 0.8 else rng.uniform(0.1, 0.9)
        level = min(max(level, 0.1), 0.9)
        m = n + round(rng.uniform(0.5, 1.5) * rest / period)
        u[n:m] = level
        n = m
    return u
