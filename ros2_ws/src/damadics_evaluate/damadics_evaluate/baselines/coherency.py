# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Squared coherency of CV and X: how far the stem still follows its command."""

import numpy as np

from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import CV, Detector, X, require

BLOCK = 4096  # windows transformed at once


class Coherency(Detector):
    """
    One minus the squared coherency of CV and X', averaged over the band that CV excites.

    Model-free. Welch's estimate over a sliding window; the band is where the fault-free record
    has a coherency above `coherent` (Choudhury, Shah, Thornhill: Diagnosis of Process
    Nonlinearities and Valve Stiction, 2008, use it for loops).

    :param window: samples of one estimate.
    :param segment: samples of one of its segments, half overlapping.
    :param every: samples between two estimates; the value holds until the next one.
    """

    name, title = 'coherency', 'squared coherency of CV and X (scipy)'

    def __init__(self, window: int = 256, segment: int = 64, every: int = 8) -> None:
        self.window = window
        self.segment = segment
        self.every = every
        self.coherent = 0.8

    def fit(self, hour: Floats) -> None:
        """Choose the band, the largest coherency if none is above `coherent`."""
        signal = require('scipy.signal', self.name)
        rows = self.learning_rows(hour)
        _, squared = signal.coherence(rows[:, CV], rows[:, X], nperseg=self.segment)
        squared = np.nan_to_num(squared)
        self._band = squared >= min(self.coherent, float(squared.max()))

    def statistic(self, samples: Floats) -> Floats:
        """Return 1 - mean coherency over the band, 0 until a window is full."""
        signal = require('scipy.signal', self.name)
        out = np.zeros(len(samples))
        if len(samples) < self.window:
            return out
        windows = [
            np.lib.stride_tricks.sliding_window_view(samples[:, i], self.window)[:: self.every]
            for i in (CV, X)
        ]
        values = []
        for first in range(0, len(windows[0]), BLOCK):
            cv, x = (w[first : first + BLOCK] for w in windows)
            with np.errstate(invalid='ignore', divide='ignore'):  # a signal that does not move
                _, squared = signal.coherence(cv, x, nperseg=self.segment, axis=-1)
            values.append(np.nan_to_num(squared)[:, self._band].mean(axis=1))
        held = np.repeat(1.0 - np.concatenate(values), self.every)
        n = len(samples) - self.window + 1
        out[self.window - 1 :] = held[:n]
        on = self.active(samples) & (np.arange(len(samples)) >= self.window - 1)
        return np.where(on, out, 0.0)
