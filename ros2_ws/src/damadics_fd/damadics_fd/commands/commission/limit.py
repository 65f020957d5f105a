# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The limit on residual / threshold that is reached once in so many days."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.modes import PHASE_MONITOR
from damadics_fd.core.result import Result
from damadics_fd.core.settings import Settings

DAY = 86400.0
BLOCK = 10.0  # s; windows whose largest ratio counts as one draw
LEAST_BLOCKS = 20


@dataclass(frozen=True)
class Limit:
    """Hold the limit on residual/threshold for a number of false alarms."""

    ratio: float  # limit for at most one false alarm in `days`
    low: float  # 90 % interval of that limit
    high: float
    days: float
    hours: float  # monitored time in the recording
    blocks: int
    seen: float  # largest ratio in the recording
    maxima: NDArray[np.float64]
    location: float  # of the Gumbel distribution of the maxima
    scale: float

    def statement(self) -> str:
        """
        Say what the limit rests on.

        :return: for people.
        """
        factor = self.days * 24.0 / self.hours
        return (
            f'{self.hours:.2f} h of fault-free monitoring, {self.blocks} windows of {BLOCK:g} s, '
            f'largest residual/threshold {self.seen:.2f}. A limit of {self.ratio:.2f} '
            f'(90 % interval {self.low:.2f}..{self.high:.2f}) is reached once in {self.days:g} '
            f'days if the largest values go on as a Gumbel distribution and the valve works as '
            f'it did in the recording: an extrapolation by a factor of {factor:.0f} in time. '
            f'Without that assumption the recording only shows that there are fewer than '
            f'{3.0 / self.hours:.2g} false alarms per hour (95 % confidence).'
        )


def watched(result: Result, settings: Settings) -> NDArray[np.bool_]:
    """
    Tell which samples were monitored away from the stops.

    :param result: a recording through estimator and detector.
    :param settings: the settings used.
    :return: mask.
    """
    e = result.estimates
    x = e['x1_hat'] + e['xi1'] - settings.spring_origin
    mask: NDArray[np.bool_] = (
        result.accepted
        & (e['phase'] == PHASE_MONITOR)
        & (x > settings.gate_low)
        & (x < 1.0 - settings.gate_high)
    )
    return mask


def set_limit(result: Result, settings: Settings, days: float) -> Limit | None:
    """
    Find the ratio that is reached once in a number of days, from its largest values.

    A decision takes `decide_m` samples in a row or nearly so; their smallest ratio counts. The
    largest of each window of 10 s is fitted by a Gumbel distribution, by moments; its interval
    comes from 200 resamplings with a fixed seed.

    :param result: a fault-free recording through estimator and detector.
    :param settings: the settings used.
    :param days: at most one false alarm in so many days.
    :return: the limit; None where fewer than 20 windows were monitored.
    """
    counts = watched(result, settings)
    ratio = np.where(counts, result.decisions['ratio'], 0.0)
    need = settings.decide_m
    lasting = np.min([ratio[i : len(ratio) - need + 1 + i] for i in range(need)], axis=0)
    window = max(need, round(BLOCK * settings.sample_rate))
    n = len(lasting) // window
    blocks = lasting[: n * window].reshape(n, window)
    full = counts[: n * window].reshape(n, window).mean(axis=1) > 0.5
    maxima = blocks[full].max(axis=1) if n else np.zeros(0)
    if len(maxima) < LEAST_BLOCKS:
        return None
    location, scale = _gumbel(maxima)
    rng = np.random.default_rng(0)
    draws = [_gumbel(rng.choice(maxima, len(maxima))) for _ in range(200)]
    wanted = days * DAY / BLOCK
    low, high = np.percentile([_level(a, b, wanted) for a, b in draws], [5.0, 95.0])
    return Limit(
        float(f'{_level(location, scale, wanted):.3g}'),
        float(low),
        float(high),
        days,
        len(maxima) * BLOCK / 3600.0,
        len(maxima),
        float(maxima.max()),
        maxima,
        location,
        scale,
    )


def _gumbel(maxima: NDArray[np.float64]) -> tuple[float, float]:
    scale = max(float(np.std(maxima, ddof=1)) * math.sqrt(6.0) / math.pi, 1e-9)
    return float(np.mean(maxima)) - 0.5772156649 * scale, scale


def _level(location: float, scale: float, blocks: float) -> float:
    return location - scale * math.log(-math.log1p(-1.0 / max(blocks, 2.0)))
