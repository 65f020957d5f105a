# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Set mean, sigma, allowance and limit of every test from the false-alarm budget."""

import math
from statistics import NormalDist

import numpy as np

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.cusum import PROCESS, R1, R2, TESTS, siegmund_limit
from damadics_fd.core.scada.judging.decide import SHOWN, rests, weigh
from damadics_fd.core.scada.laws.robust import Floats, block_spread, spread_of
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import LAW, Reference

DAY_S = 86400.0
LONG_RECORD = 3000  # samples below which the tails of r1 are not known well enough
JUMP_CLIP = 6.0  # a jump must then last for three samples
HEAD_ROOM = 1.3  # on the largest CUSUM of the learning record
LLR_MARGINS = (1.35, 2.2)  # with stationary inputs, with wandering ones
LLR_HEAD_ROOM = 2.0
STATIONARY = 1.3  # sigma of 30 s blocks over sigma of samples, above it an input wanders
# Standard errors of the learned mean by which the allowance grows, by length of block.
STANDARD_ERRORS = {1: 0.0, 5: 4.0, 10: 4.0, 30: 5.0}
DISTANCE_ERRORS = 4.0  # and with the distance from what was learned, where the above is 0
SLOW = 30  # block of the tests that sum up hundreds of samples
SLOWEST_OF_LAW = 0.15
LAW_MARGIN = 1.0  # of an identified law, whose residual is neither white nor normal
LEAST = 200
# How long a stem is off its law where its play holds it, and how often that was seen, at least.
OFF_SAMPLES, SELDOM = 10, 0.002
OFF_ROOM = 1.2


@jit
def cusum_maximum(z: np.ndarray, k: float, clip: float) -> float:
    """Return the largest value of the two-sided CUSUM over a record of z values."""
    up = 0.0
    down = 0.0
    largest = 0.0
    for value in z:
        if math.isnan(value):
            continue
        v = min(max(value, -clip), clip)
        up = max(0.0, up + v - k)
        down = max(0.0, down - v - k)
        largest = max(largest, up, down)
    return largest


@jit
def _llr_maximum(gain: np.ndarray, wider: np.ndarray) -> float:
    g = 0.0
    before = 0.0
    largest = 0.0
    for i in range(gain.size):
        g, before = weigh(g, before, gain[i], wider[i])
        g = max(g, 0.0)
        largest = max(largest, g)
    return largest


@jit
def _moved(model: np.ndarray) -> np.ndarray:
    """Tell which samples of a record show the friction of the stem."""
    moved = np.empty(model.size, np.bool_)
    anchor = 0.0
    rest = 0
    for i in range(model.size):
        rest = rests(model[i], anchor, rest)
        if rest == 0:
            anchor = model[i]
        moved[i] = rest < SHOWN
    return moved


def block_sigma(values: Floats, length: int) -> float:
    """
    Return sqrt(L) times the deviation of the means of non-overlapping blocks of L samples.

    :param values: residual, shape (n,).
    :param length: L; 1 gives the ordinary standard deviation.
    :return: sigma that a sum over L samples shows, with the autocorrelation in it.
    """
    n = values.size // length
    if n < 2:
        return float(values.std())
    means = values[: n * length].reshape(n, length).mean(axis=1)
    return float(math.sqrt(length) * means.std())


def is_stationary(values: Floats) -> bool:
    """Tell whether an input has no slow component, so that its mean can be tested."""
    values = values[np.isfinite(values)]
    sigma = block_sigma(values, 1)
    blocks = values.size // 30
    return bool(block_sigma(values, 30) <= sigma * (STATIONARY + 1.0 / math.sqrt(blocks)))


def arl_per_test(settings: ScadaSettings, period: float) -> float:
    """Return the mean samples between false alarms each one-sided test may have."""
    tests = 2 * len(TESTS) - 1
    return settings.days_per_false_alarm * DAY_S / period * tests


def inliers(values: Floats) -> Floats:
    """Return the finite values, those beyond 6 robust sigma pulled in."""
    v = values[np.isfinite(values)]
    if not v.size:
        return v
    middle, reach = float(np.median(v)), 6.0 * max(spread_of(v), float(v.std()) / 6.0 * 0.5)
    pulled: Floats = np.clip(v, middle - reach, middle + reach)
    return pulled


def set_limits(
    ref: Reference,
    settings: ScadaSettings,
    values: Floats,
    sigma: Floats,
    slow: float,
    wandering: bool,
) -> None:
    """
    Set mu, sigma, allowance and limit of every CUSUM from the budget.

    :param ref: record of `REFERENCE`, written.
    :param settings: budget and period.
    :param values: the residuals over the record, one column each, NaN where not testable.
    :param sigma: of a residual with a dead zone, whose `values` show too little; NaN: learn it.
    :param slow: factor on sigma for sums of r2 over many samples.
    :param wandering: the inputs have no constant mean.
    """
    arl = arl_per_test(settings, max(settings.period_s, float(ref.period)))
    for i, test in enumerate(TESTS):
        margin = test.wandering if wandering else test.margin
        if not margin > 0.0:
            continue
        if test.residual == PROCESS:
            if ref.drop > 0.0:
                ref.mu[i], ref.sd[i], ref.k[i] = 0.0, 1.0, 0.5
                ref.h[i], ref.clip[i] = 0.999, 1.0
            continue
        law = (test.residual == R1 and ref.stem_kind == LAW) or (
            test.residual == R2 and ref.flow_kind == LAW
        )
        r = inliers(values[:, test.residual])
        if r.size < LEAST // 2:
            continue
        if law:
            _of_law(ref, i, r, float(sigma[test.residual]), arl)
            continue
        sd = block_sigma(r, 1)
        if test.residual == R2 and test.block == SLOW:
            sd *= slow
        sd = max(sd, block_sigma(r, test.block))
        if not sd > 0.0:  # an input without any noise: nothing to test
            continue
        mu = float(r.mean())
        n = r.size
        if test.k0 == 4.0:
            quantile = NormalDist().inv_cdf(1.0 - 0.25 / n)
            sd *= max(1.0, float(np.abs(r - mu).max()) / sd / quantile)
        k = test.k0 + STANDARD_ERRORS[test.block] / math.sqrt(n)
        clip = test.clip
        if (wandering or n < LONG_RECORD) and test.residual == R1 and test.k0 == 4.0:
            clip = JUMP_CLIP
        largest = cusum_maximum((r - mu) / sd, k, clip)
        ref.mu[i], ref.sd[i], ref.k[i], ref.clip[i] = mu, sd, k, clip
        ref.se[i] = (STANDARD_ERRORS[test.block] or DISTANCE_ERRORS) / math.sqrt(n)
        ref.h[i] = max(margin * siegmund_limit(k, arl), HEAD_ROOM * largest)


def wander_of(r: Floats) -> float:
    """
    Return by how much a residual is off for some samples now and then.

    A play that a law knows but in part leaves the stem beside it for as long as CV rests.

    :param r: stem residual of an identified law, NaN where not testable.
    """
    v = r[np.isfinite(r)]
    if v.size < LEAST // 2:
        return 0.0
    sums = np.cumsum(np.r_[0.0, v])
    means = np.abs(sums[OFF_SAMPLES:] - sums[:-OFF_SAMPLES]) / OFF_SAMPLES
    return OFF_ROOM * float(np.quantile(means, 1.0 - SELDOM))


def _of_law(ref: Reference, i: int, r: Floats, sigma: float, arl: float) -> None:
    """Set one test of an identified law: the dead zone is in the residual, its mean is 0."""
    test = TESTS[i]
    if test.k0 < SLOWEST_OF_LAW:
        return  # slower than the changes a plant makes by itself
    one = sigma if sigma > 0.0 else max(spread_of(r), 1.0)
    sd = max(one, block_spread(r, test.block))
    largest = cusum_maximum(r / sd, test.k0, test.clip)
    ref.mu[i], ref.sd[i], ref.k[i], ref.clip[i] = 0.0, sd, test.k0, test.clip
    ref.h[i] = max(LAW_MARGIN * siegmund_limit(test.k0, arl), HEAD_ROOM * largest)


def friction_limit(
    ref: Reference,
    settings: ScadaSettings,
    r1: Floats,
    model: Floats,
    wider: Floats,
    wandering: bool,
) -> None:
    """
    Set the limit of the likelihood-ratio test for friction.

    :param ref: record of `REFERENCE`, written.
    :param settings: budget.
    :param r1: stem residual, NaN where not testable.
    :param model: position of the model.
    :param wider: the same less that of the copy with the wider play.
    :param wandering: the inputs have no constant mean.
    """
    ok = np.isfinite(r1)
    r, wide_by = r1[ok], wider[ok]
    s1 = float(inliers(r).std())
    kap2 = max(1.0, (block_sigma(inliers(r), 5) / s1) ** 2)
    apart = wide_by / s1
    gain = ((r / s1) ** 2 - (r / s1 + apart) ** 2) / (2.0 * kap2)
    gain[~_moved(model)[ok]] = 0.0
    ref.s1, ref.kap2 = s1, kap2
    arl = arl_per_test(settings, max(settings.period_s, float(ref.period)))
    ref.llr_limit = max(
        LLR_MARGINS[wandering] * math.log(arl), LLR_HEAD_ROOM * _llr_maximum(gain, apart)
    )
