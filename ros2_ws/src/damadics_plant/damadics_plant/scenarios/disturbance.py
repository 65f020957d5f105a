# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The benchmark's disturbances (block ADist): white noise and 50 Hz hum on every signal."""

import numpy as np
from damadics_fd.core.sample import SIGNALS

from damadics_plant.actuator.parameters import RANGES

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

    @staticmethod
    def hum(first: int, every: int, n: int, rate: float) -> np.ndarray:
        """
        Evaluate the 50 Hz hum.

        :param first: first tick.
        :param every: ticks per sample.
        :param n: number of samples.
        :param rate: ticks per second.
        :return: share of the range, shape (n,).
        """
        ticks = np.arange(first, first + n * every, every)
        hum: np.ndarray = HUM * np.sin(2 * np.pi * np.mod(50.0 * ticks / rate, 1.0))
        return hum

    def disturb(self, name: str, values: np.ndarray, every: int, hum: np.ndarray) -> np.ndarray:
        """
        Disturb a block of a signal.

        :param name: one of `SIGNALS`.
        :param values: samples in SI, shape (n,).
        :param every: ticks per sample; noise is drawn for each tick, so that a slower recorder
            sees every n-th of the same samples.
        :param hum: at the samples, shape (n,).
        :return: disturbed samples within the range of the transmitter, shape (n,).
        """
        white = self._streams[name].standard_normal(len(values) * every)[::every]
        if name == 'ps':
            return values + CHAMBER_NOISE * white
        span = RANGES[name]
        disturbed: np.ndarray = np.clip(values + span * (hum + WHITE * white), 0.0, span)
        return disturbed
