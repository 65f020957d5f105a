# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Quantities of the trends for people: their units, and when they meet a limit."""

import math
from collections.abc import Sequence

from damadics_fd.store.intervals import Series
from damadics_fd.store.trend_fit import Trend, fit_recent

from damadics_dashboard.words.texts import Texts

UNITS = {  # factor from what is stored, unit shown
    'spring': (100.0, '%'),
    'preload': (1.0, 'N'),
    'friction': (100.0, '%'),
    'play': (100.0, '%'),
    'travel': (1.0, '1/h'),
    'reversals': (1.0, '1/h'),
    'cycles': (1.0, '1/h'),
    'unstroked': (1.0 / 86400.0, 'd'),
    'supply': (100.0, '%'),
}
CHANGES = ('spring', 'preload', 'friction')  # told with their sign: against the reference
LEAST_STD = 1e-6
FAR = 30 * 365.25 * 86400.0  # s; nobody plans for what is further away


def factor_of(quantity: str) -> float:
    """
    Return the factor from what is stored to what is shown.

    :param quantity: its name.
    :return: the factor.
    """
    return UNITS[quantity][0]


def unit_of(quantity: str) -> str:
    """
    Return the unit that a quantity is shown in.

    :param quantity: its name.
    :return: the unit.
    """
    return UNITS[quantity][1]


def value_words(quantity: str, value: float, t: Texts) -> str:
    """
    Word a value.

    :param quantity: its name.
    :param value: as stored.
    :param t: the words.
    :return: text with its unit.
    """
    if not math.isfinite(value):
        return '–'
    factor, unit = UNITS[quantity]
    value *= factor
    if quantity in CHANGES:
        value = round(value, 2)
        return f'{t.local(f"{value:+.3g}" if value else "0")} {unit}'
    return f'{t.local(f"{value:.3g}")} {unit}'


def trend_of(found: Series) -> Trend | None:
    """
    Fit the recent part of a trend with a straight line.

    :param found: the trend.
    :return: the line; None where there are too few points.
    """
    if len(found.start) < 5:
        return None
    scatter = max(float(found.mean.std()), LEAST_STD)
    std = [s if math.isfinite(s) and s > 0.0 else scatter for s in found.std.tolist()]
    return fit_recent(found.start, found.mean, std)


def outlook_words(
    quantity: str, found: Series, limits: Sequence[float], now: float, t: Texts
) -> str:
    """
    Say how a quantity is and when it meets a limit.

    :param quantity: its name.
    :param found: its trend.
    :param limits: the limits.
    :param now: present time [s].
    :param t: the words.
    :return: one or two sentences.
    """
    if not len(found.start):
        return t('no_trend_yet')
    value = value_words(quantity, float(found.mean[-1]), t)
    said = t('trend_now', what=t(f'trend_{quantity}'), value=value)
    line = trend_of(found)
    if line is None or not limits:
        return said
    times = [(line.time_to(limit, now), limit) for limit in limits]
    time, limit = min(times, key=lambda pair: (pair[0].expected, pair[0].earliest))
    shown = value_words(quantity, limit, t)
    if time.expected > FAR:
        return f'{said} {t("trend_steady")}'
    if time.expected == 0.0:
        return f'{said} {t("trend_beyond", limit=shown)}'
    latest = t('trend_never') if math.isinf(time.latest) else t.duration(time.latest)
    earliest = t.duration(time.earliest)
    expected = t.duration(time.expected)
    return f'{said} ' + t(
        'trend_meets', limit=shown, expected=expected, earliest=earliest, latest=latest
    )
