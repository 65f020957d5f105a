# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The good samples of all recordings on one axis of time, and their block means."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.core.approximator.transmitter import delay_column
from damadics_fd.core.record import Floats, Ints
from damadics_fd.core.settings.identified import FaultFree
from damadics_fd.core.signature.blocks import STEADY
from damadics_fd.core.signature.sliding import BEYOND_NOISE, STAIRS

NEEDED = ('cv', 'x1', 'p1', 'p2', 'ps')
APART = 60.0  # s between two recordings on the common axis
GAP = 2.0  # s; delays start afresh after a longer one
WHOLE = 0.75  # of the samples that a block needs
SLOWEST, FASTEST = 0.02, 1.5  # strokes/s of a moving block
STOPS = 0.03  # of the stroke next to a stop, where a block does not count
VARIES = 1e-3  # of P1 - P2: less of a variation is none
RATES = 0.02  # share by which the rates of two recordings may differ


@dataclass(frozen=True)
class Signals:
    """Hold samples in which every needed signal is there; times in s, pressures in Pa."""

    t: Floats
    cv: Floats
    x: Floats
    dp: Floats  # P1 - P2
    ps: Floats
    part: Ints  # index of the recording
    rate: float  # Hz
    good: float  # share of the samples that are good


@dataclass(frozen=True)
class Blocks:
    """Hold means of whole blocks; `v` is NaN where a neighbour is missing."""

    width: float  # s
    index: Ints
    part: Ints
    t: Floats
    x: Floats
    cv: Floats
    dp: Floats
    ps: Floats
    v: Floats  # strokes/s
    rate_dp: Floats  # Pa/s
    rough: Floats  # variance of the position about a straight motion

    @property
    def moving(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """
        Tell which blocks lie in a steady motion away from the stops.

        :return: mask.
        """
        return self._in_motion(STEADY)

    @property
    def sticky(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """
        Tell about which blocks the stem sticks and slips: it moves by stairs.

        A block may lie within one slip, so that its neighbours tell as well.

        :return: mask.
        """
        noise = float(np.percentile(self.rough, 25.0))
        way = STAIRS * np.abs(np.nan_to_num(self.v)) * self.width
        rough = np.maximum(self.rough, np.maximum(np.roll(self.rough, 1), np.roll(self.rough, -1)))
        return rough > np.maximum(BEYOND_NOISE * noise, noise + way**2)

    @property
    def jumps(self) -> float:
        """
        Tell how much of the motion is jumps: blocks in which the stem breaks away or stops.

        :return: share of the blocks in motion.
        """
        every = int(np.sum(self._in_motion(0.0)))
        return 1.0 - int(np.sum(self.moving)) / max(every, 1)

    def _in_motion(self, steady: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        before, after = _steps(self)
        low = np.minimum(np.abs(before), np.abs(after))
        high = np.maximum(np.abs(before), np.abs(after))
        least = np.maximum(0.5 * SLOWEST * self.width, steady * high)
        inside = (self.x > STOPS) & (self.x < 1.0 - STOPS)
        fast = (np.abs(self.v) >= SLOWEST) & (np.abs(self.v) < FASTEST)
        one_way = (before * after > 0.0) & (low >= least)
        return inside & fast & one_way & np.isfinite(self.v)

    @property
    def standing(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """
        Tell which blocks rest away from the stops.

        :return: mask.
        """
        before, after = _steps(self)
        most = np.maximum(np.abs(before), np.abs(after))
        inside = (self.x > STOPS) & (self.x < 1.0 - STOPS)
        return inside & (np.abs(self.v) < SLOWEST) & (most < 1.5 * SLOWEST * self.width)


def _steps(b: Blocks) -> tuple[Floats, Floats]:
    step = np.diff(b.x, prepend=np.nan, append=np.nan)
    near = np.diff(b.index, prepend=-9, append=1 << 60) == 1
    step = np.where(near, step, np.nan)
    return step[:-1], step[1:]


def sample_rate(stamps: Ints) -> float:
    """
    Return the nominal sample rate.

    :param stamps: [ns].
    :return: [Hz], rounded to 4 digits.
    :raises CommissioningError: where there are no two samples in order.
    """
    steps = np.diff(np.asarray(stamps, np.int64))
    steps = steps[steps > 0]
    if not len(steps):
        raise CommissioningError('the stamps do not rise')
    return float(f'{1e9 / float(np.median(steps)):.4g}')


def gather(recordings: Sequence[FaultFree]) -> Signals:
    """
    Put the good samples of recordings on one axis of time.

    :param recordings: with every needed signal, of one valve.
    :return: the samples.
    :raises CommissioningError: where the rates of the recordings differ.
    """
    rates = {r.name: sample_rate(np.asarray(r.columns['stamp'], np.int64)) for r in recordings}
    rate = float(np.median(list(rates.values())))
    odd = [f'{n} has {v:g} Hz' for n, v in rates.items() if abs(v / rate - 1.0) > RATES]
    if odd:
        raise CommissioningError(
            f'the recordings differ in their rate: {", ".join(odd)}, the others {rate:g} Hz; '
            'commission with recordings of one rate'
        )
    pieces, begin, total = [], 0.0, 0
    for k, recording in enumerate(recordings):
        stamp = np.asarray(recording.columns['stamp'], np.int64)
        rows = np.stack([np.asarray(recording.columns[name], float) for name in NEEDED])
        good = np.isfinite(rows).all(axis=0)
        highest = np.maximum.accumulate(np.where(good, stamp, stamp[0] - 1))
        good[1:] &= stamp[1:] > highest[:-1]
        total += len(stamp)
        stamp, rows = stamp[good], rows[:, good]
        if len(stamp):
            t = begin + (stamp - stamp[0]) * 1e-9
            pieces.append((t, rows, np.full(len(t), k)))
            begin = float(t[-1]) + APART
    if not pieces:
        raise CommissioningError(
            f'in no sample are all of {", ".join(NEEDED)} measured: see verify'
        )
    t = np.concatenate([piece[0] for piece in pieces])
    cv, x, p1, p2, ps = np.concatenate([piece[1] for piece in pieces], axis=1)
    part = np.concatenate([piece[2] for piece in pieces])
    return Signals(t, cv, x, p1 - p2, ps, part, rate, len(t) / total)


def blocks(signals: Signals, width: float, lag: float = 0.0, carried: float = 0.0) -> Blocks:
    """
    Return means over blocks of which enough samples are good.

    :param signals: the samples.
    :param width: of a block [s].
    :param lag: position and P1 - P2 are delayed by it first, as the chamber pressure is [s].
    :param carried: how long a slip is felt at least, where lags are compared [s].
    :return: whole blocks in order of time.
    """
    x, dp = signals.x, signals.dp
    if lag > 0.0:
        dt = np.diff(signals.t, prepend=-np.inf)
        dt[dt > GAP] = np.inf
        x, dp = delay_column(x, dt, lag), delay_column(dp, dt, lag)
    index = np.floor(signals.t / width + 1e-6).astype(np.int64)
    first = np.flatnonzero(np.diff(index, prepend=index[0] - 1))
    count = np.diff(first, append=len(index))
    whole = count >= max(1, int(np.ceil(WHOLE * width * signals.rate - 1e-9)))

    def means(signal: Floats) -> Floats:
        mean: Floats = (np.add.reduceat(signal, first) / count)[whole]
        return mean

    t, mx, mdp = means(signals.t), means(x), means(dp)
    within = signals.t - np.repeat(index[first], count) * width
    mt = means(within)
    raw = means(signals.x)  # a delay would smooth the stairs
    both = means(signals.x * within) - raw * mt
    rough = means(signals.x**2) - raw**2 - both**2 / np.maximum(means(within**2) - mt * mt, 1e-12)
    index, part = index[first][whole], signals.part[first][whole]
    mid = np.zeros(len(t), bool)
    mid[1:-1] = (np.diff(index)[1:] == 1) & (np.diff(index)[:-1] == 1)
    v, rate_dp = np.full(len(t), np.nan), np.zeros(len(t))
    if len(t) > 2:
        span = t[2:] - t[:-2]
        v[1:-1] = (mx[2:] - mx[:-2]) / span
        rate_dp[1:-1] = (mdp[2:] - mdp[:-2]) / span
    v[~mid] = np.nan
    mcv, mps, rough = means(signals.cv), means(signals.ps), np.maximum(rough, 0.0)
    felt = max(lag, carried)
    if felt > 0.0:  # what the delay carries over from the block before
        rough[1:] = np.maximum(rough[1:], rough[:-1] * np.exp(-width / felt))
    return Blocks(width, index, part, t, mx, mcv, mdp, mps, v, rate_dp, rough)


def calm(b: Blocks) -> Floats:
    """
    Return P1 - P2 as the blocks beside each show it, or its mean where it is steady.

    With its own noise in a column, the best correction of the plug force would be the one that
    takes the noise out of the balance: none of it, where P1 - P2 is steady.

    :param b: blocks.
    :return: [Pa].
    """
    if steady(b):
        return np.full(len(b.dp), float(np.mean(b.dp[b.moving])))
    return _beside(b)


def steady(b: Blocks) -> bool:
    """
    Tell whether P1 - P2 varies too little, its noise apart, to tell the plug force by.

    :param b: blocks.
    :return: True where it does.
    """
    use = b.moving
    if not use.any():
        return True
    dp, near = b.dp[use], _beside(b)[use]
    together = float(np.mean((dp - np.mean(dp)) * (near - np.mean(near))))  # no noise in common
    return together < (VARIES * max(float(np.mean(np.abs(dp))), 1.0)) ** 2


def _beside(b: Blocks) -> Floats:
    found: Floats = b.dp.copy()
    whole = b.index[4:] - b.index[:-4] == 4
    mean = 0.25 * (b.dp[:-4] + b.dp[1:-3] + b.dp[3:-1] + b.dp[4:])
    found[2:-2] = np.where(whole, mean, found[2:-2])
    return found
