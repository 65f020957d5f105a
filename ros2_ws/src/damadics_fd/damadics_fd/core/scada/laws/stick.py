# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
How far friction holds a stem off where it is sent, from a fault-free record.

A stem that sticks stands still while the command moves on, then slips. Where in between it stands
depends on what it did before, and a lag hides it from the fit of a law. It shows where the stem
is at rest outside what lies between the command and the law.
"""

import numpy as np

from damadics_fd.core.scada.laws.robust import Floats

MEAN = 5  # samples whose mean is compared
AT_REST = 2.5  # standard deviations of a change of such a mean
OFTEN = 0.99  # quantile of how far it is off
ROOM = 1.3  # a short record hardly shows the most
LEAST = 0.005  # of the stroke: less is play as any stem has it
FEWEST = 60  # samples at rest that tell something
NOISY, CLEAR = 0.004, 2.0  # of the stroke: noise in which rest is not seen; multiples of it
# A stem that mostly rests and is stepped to few places has not shown how far off it may rest.
RESTS, PLACES, APART, STEPPED, UNSEEN = 0.7, 3, 0.01, 0.05, 0.03
BETWEEN = 0.3  # share of its motion that such places cover at most; more is a stem that wanders


def stick_of(x: Floats, cv: Floats, law: Floats, band: float = 0.0) -> float:
    """
    Return how far off a stem may rest; 0 where it does not stick.

    :param x: measured position, shape (n,), regular in time but for gaps.
    :param cv: command; law: position of the identified law; band: its play, within which the
        stem may be anywhere.
    :return: share of the stroke.

    >>> command = np.r_[np.linspace(0.5, 0.52, 400), np.linspace(0.52, 0.5, 400)]
    >>> round(stick_of(0.5 + 1e-5 * (np.arange(800) % 2), command, command), 3)
    0.026
    >>> stick_of(command, command, command)
    0.0
    """
    held = band if band > 2.0 * LEAST else 0.0
    if len(x) < FEWEST:
        return held
    noise = 1.4826 * float(np.median(np.abs(np.diff(x)))) / np.sqrt(2.0)
    if noise > NOISY:
        return 0.0
    kernel = np.ones(MEAN) / MEAN
    mean, command, model = (np.convolve(v, kernel, 'valid') for v in (x, cv, law))
    moved = float(np.ptp(mean))
    change = np.abs(mean[MEAN:] - mean[:-MEAN])
    rest = change < max(AT_REST * noise * np.sqrt(2.0 / MEAN), 1e-5)
    mean, command, model = (v[MEAN:][rest] for v in (mean, command, model))
    if len(mean) < FEWEST:
        return held
    if len(mean) > RESTS * len(rest) and moved > STEPPED:
        steps = np.diff(np.sort(mean))
        steps = steps[steps > APART]
        covered = float(np.ptp(mean) - steps.sum())
        if len(steps) < PLACES and covered < BETWEEN * moved:
            held = max(held, UNSEEN)
    low, high = np.minimum(command, model), np.maximum(command, model)
    off = float(np.quantile(np.abs(mean - np.clip(mean, low, high)), OFTEN))
    return max(held, ROOM * off if off > max(LEAST, CLEAR * noise) else 0.0)
