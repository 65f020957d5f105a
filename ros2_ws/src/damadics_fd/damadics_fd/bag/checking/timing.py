# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""When the messages of a topic came: rate, gaps, jitter, duplicates, in bounded memory."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

SECOND = 1e9  # [ns]
PER_OCTAVE = 16  # bins of the intervals: the median is right to 2 %
BINS = 64 * PER_OCTAVE
GAP = 3.0  # typical intervals from which on a silence is a gap


@dataclass
class Timing:
    """
    When messages came, by their own stamps where they have such, else by the log time.

    :param start: first log time [ns].
    :param end: last log time [ns].
    :param count: messages.
    :param steps_back: stamps smaller than the one before.
    :param duplicates: stamps equal to the one before.
    :param zero_stamps: stamps of zero, which nobody has set.
    :param negative: stamps or log times that do not fit 63 bits.
    :param max_gap: longest interval [ns].
    """

    start: int = 0
    end: int = 0
    count: int = 0
    steps_back: int = 0
    duplicates: int = 0
    zero_stamps: int = 0
    negative: int = 0
    max_gap: int = 0
    _first: int = field(default=0, repr=False)
    _last: int = field(default=0, repr=False)
    _forward: int = field(default=0, repr=False)  # intervals greater than zero
    _sum: float = field(default=0.0, repr=False)
    _squares: float = field(default=0.0, repr=False)
    _bins: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64), repr=False)

    def note(self, log_time: NDArray[np.int64], stamp: NDArray[np.int64]) -> None:
        """Take the next messages: log times and stamps [ns]."""
        first, last = int(log_time.min()), int(log_time.max())
        self.start = min(first, self.start) if self.count else first
        self.end = max(last, self.end) if self.count else last
        self.negative += int(((log_time < 0) | (stamp < 0)).sum())
        self.zero_stamps += int((stamp == 0).sum())
        if self.count:
            interval = np.diff(stamp, prepend=self._last)
        else:
            interval, self._first = np.diff(stamp), int(stamp[0])
        self.count += len(stamp)
        self._last = int(stamp[-1])
        if not len(interval):
            return
        self.steps_back += int((interval < 0).sum())
        self.duplicates += int((interval == 0).sum())
        forward = interval[interval > 0]
        if not len(forward):
            return
        self.max_gap = max(self.max_gap, int(forward.max()))
        seconds = forward / SECOND
        self._forward += len(forward)
        self._sum += float(seconds.sum())
        self._squares += float((seconds * seconds).sum())
        bins = (np.log2(forward) * PER_OCTAVE).astype(np.int64)
        if not len(self._bins):  # thousands of topics may never have two messages
            self._bins = np.zeros(BINS, np.int64)
        self._bins += np.bincount(bins, minlength=BINS)[:BINS]

    @property
    def period(self) -> float:
        """Typical interval: the median [s]."""
        if not self._forward:
            return 0.0
        middle = int(np.searchsorted(np.cumsum(self._bins), (self._forward + 1) // 2))
        return float(2.0 ** ((middle + 0.5) / PER_OCTAVE)) / SECOND

    @property
    def rate(self) -> float:
        """Messages per second, on average."""
        span = (self._last - self._first) / SECOND
        return (self.count - 1) / span if span > 0.0 else 0.0

    @property
    def jitter(self) -> float:
        """Standard deviation of the intervals [s]."""
        if not self._forward:
            return 0.0
        mean = self._sum / self._forward
        return float(max(self._squares / self._forward - mean * mean, 0.0) ** 0.5)

    @property
    def gaps(self) -> int:
        """Intervals longer than `GAP` typical ones."""
        if not self._forward:
            return 0
        first = int(np.log2(self.period * GAP * SECOND) * PER_OCTAVE) + 1
        return int(self._bins[first:].sum())
