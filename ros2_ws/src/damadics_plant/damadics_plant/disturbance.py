# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The benchmark's disturbances (block ADist): white noise and 50 Hz hum on every signal."""

import numpy as np

from damadics_plant.parameters import RANGES

SIGNALS = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
"""Disturbed signals, each with a random stream of its own."""

WHITE = np.sqrt(5e-9 / 0.0025)
"""Standard deviation of the band-limited white noise, share of the range."""

HUM = 0.0025
"""Amplitude of the 50 Hz hum, share of the range."""

CHAMBER_NOISE = 80.0
"""
Standard deviation of the chamber pressure's noise [Pa]: 1e-3 of the bench set's span.

Not part of the benchmark, whose detectors do not get the chamber pressure.
"""


class Disturbance:
    """
    Disturbs the signals of a run block by block; blocks of any size give the same signals.

    :ivar seed: the same seed gives the same noise.
    """

    def __init__(self, seed: int) -> None:
        """
        Start every stream at scenario zero.

        :param seed: any integer >= 0.
        """
        children = np.random.SeedSequence(seed).spawn(len(SIGNALS))
        self._streams = {
            name: np.random.Generator(np.random.PCG64(child))
            for name, child in zip(SIGNALS, children, strict=True)
        }

    def disturb(self, name: str, values: np.ndarray, first: int, every: int,
                rate: float) -> np.ndarray:
        """
        Disturb a block of a signal.

        :param name: one of `SIGNALS`.
        :param values: samples at ticks first, first + every, ... in SI; shape (n,).
        :param first: tick of the first sample.
        :param every: ticks per sample; noise is drawn for each tick.
        :param rate: ticks per second.
        :return: disturbed samples within the range of the transmitter, shape (n,).
        """
        n = len(values)
        white = self._streams[name].standard_normal(n * every)[::every]
        if name == 'ps':
            return values + CHAMBER_NOISE * white
        hum = np.sin(2 * np.pi * np.mod(50.0 * (first + every * np.arange(n)) / rate, 1.0))
        span = RANGES[name]
        disturbed: np.ndarray = np.clip(values + span * (HUM * hum + WHITE * white), 0.0, span)
        return disturbed
