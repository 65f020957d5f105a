# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Learn the reference of one valve from a fault-free record: filters, bias, sigmas, limits."""

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.cusum import R1, R2, TESTS, siegmund_limit
from damadics_fd.core.scada.pressure import learn_pressure
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import BASIC_WEIGHTS, MONITOR, N_WEIGHTS, REFERENCE
from damadics_fd.core.scada.step import LLR_CLIP, predict

Floats = NDArray[np.float64]
DAY_S = 86400.0
LONG_RECORD = 3000  # samples below which the tails of r1 are not known well enough
JUMP_CLIP = 6.0  # a jump must then last for three samples
HEAD_ROOM = 1.3  # on the largest CUSUM of the learning record
LLR_MARGINS = (1.6, 2.2)  # with stationary inputs, with wandering ones
LLR_HEAD_ROOM = 2.0
RIDGE = 1e-4
STATIONARY = 1.3  # sigma of 30 s blocks over sigma of samples, above it an input wanders
EARNED = 0.9  # the further regressors must cut the variance of the second half to this share
MINIMUM_TRAVEL = 0.5
# Standard errors of the learned mean by which the allowance grows, by length of block.
STANDARD_ERRORS = {1: 0.0, 5: 4.0, 10: 4.0, 30: 5.0}
SLOW = 30  # block of the tests that sum up hundreds of samples
NEVER = 9.0  # a change of CV, which is 0..1, is never as large
JUMPS = (0.05, 3.0)  # a jump of CV is more than this, and than this times the largest learned


class LearningError(ValueError):
    """The record cannot serve as a reference; the message names cause and remedy."""


@dataclass(frozen=True)
class Prediction:
    """Models and regressors over a record, one row per sample."""

    phi: Floats
    xm: Floats
    xd: Floats
    f: Floats
    sq: Floats
    innovation: Floats
    masked: NDArray[np.bool_]


@jit
def _predict_record(
    state: np.ndarray,
    settings: np.ndarray,
    reference: np.ndarray,
    samples: np.ndarray,
    phi: np.ndarray,
    models: np.ndarray,
) -> None:
    s = state[0]
    for i in range(samples.shape[0]):
        r = samples[i]
        predict(s, settings[0], reference[0], r[0], r[1], r[2], r[3], r[4], r[5], r[6])
        phi[i, :] = s.phi
        models[i, 0] = s.xm[0]
        models[i, 1] = s.xd
        models[i, 2] = s.f
        models[i, 3] = s.sq
        models[i, 4] = s.innovation[0]
        models[i, 5] = s.innovation[1]
        models[i, 6] = 1.0 if s.masked else 0.0


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
def _llr_maximum(gain: np.ndarray) -> float:
    g = 0.0
    largest = 0.0
    for value in gain:
        g = max(0.0, g + min(max(value, -LLR_CLIP), LLR_CLIP))
        largest = max(largest, g)
    return largest


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


def learn(samples: Floats, settings: ScadaSettings) -> NDArray:
    """
    Return the reference learned from a fault-free record (sheet section 1.3).

    :param samples: rows t (s), CV, X', P1', P2', T1', F' (0..1, NaN where not measured), from
        the start of the record on.
    :param settings: the window to learn from, the budget, the actuator.
    :return: structured array of `REFERENCE`, length 1.
    :raises LearningError: for a record that is too short or in which the valve hardly moves.
    """
    t = samples[:, 0] - samples[0, 0]
    window = (t >= settings.learn_from_s) & (t < settings.learn_s)
    n = int(window.sum())
    if n < 200:
        raise LearningError(f'{n} samples after {settings.learn_from_s:g} s: record 200 or more')
    travel = float(np.abs(np.diff(samples[window, 2])).sum())
    if travel < MINIMUM_TRAVEL:
        raise LearningError(
            f'the valve travelled {travel:.2f} of its stroke: learn while it works, '
            f'{MINIMUM_TRAVEL:g} or more'
        )
    reference = np.zeros(1, REFERENCE)
    ref = reference[0]
    ref['n'] = n
    ref['dp_mean'] = float(np.mean(samples[window, 3] - samples[window, 4]))
    for i, column in enumerate((3, 4)):
        learn_pressure(samples[window, column], settings.sigma, ref['pressure'][i : i + 1])
    x = samples[window, 2]
    candidates = [_predict(samples, settings, reference, window, hold) for hold in (False, True)]
    _, hold, used = min(
        (_held_out(c.phi, x - c.xm, used) / earned, hold, used)
        for hold, c in enumerate(candidates)
        for used, earned in ((BASIC_WEIGHTS, 1.0), (N_WEIGHTS, EARNED))
    )
    ref['hold'] = hold > 0
    smallest, factor = JUMPS
    largest = float(np.abs(np.diff(samples[window, 1])).max())
    ref['cv_jump'] = NEVER if hold else max(smallest, factor * largest)
    prediction = candidates[hold]
    ref['w'][:used], r1 = _bias(prediction.phi, x - prediction.xm, used)
    r2 = _flow_residual(ref, prediction, samples[window, 6])
    slow = _slow_flow_sigma(ref, settings, prediction, samples[window])
    wandering = not all(_stationary(v) for v in samples[window, 3:6].T if not np.isnan(v).all())
    values = (r1, r2, *prediction.innovation.T, samples[window, 5])
    _limits(ref, settings, values, slow, wandering)
    _friction_limit(ref, settings, r1, prediction, wandering)
    return reference


def _predict(
    samples: Floats, settings: ScadaSettings, reference: NDArray, window: NDArray, hold: bool
) -> Prediction:
    trial = reference.copy()
    trial['hold'] = hold
    phi = np.empty((len(samples), N_WEIGHTS))
    models = np.empty((len(samples), 7))
    _predict_record(np.zeros(1, MONITOR), settings.record(), trial, samples, phi, models)
    phi, models = phi[window], models[window]
    xm, xd, f, sq = models[:, :4].T
    return Prediction(phi, xm, xd, f, sq, models[:, 4:6], models[:, 6] > 0)


def _bias(phi: Floats, error: Floats, used: int) -> tuple[Floats, Floats]:
    """Return ridge weights of the first `used` regressors and what they leave of the error."""
    design = phi[:, :used]
    ridge = RIDGE * len(error) * np.eye(used)
    ridge[0, 0] = 0.0
    w = np.asarray(np.linalg.solve(design.T @ design + ridge, design.T @ error), np.float64)
    left: Floats = error - design @ w
    return w, left


def _held_out(phi: Floats, error: Floats, used: int) -> float:
    half = len(error) // 2
    w, _ = _bias(phi[:half], error[:half], used)
    return float(np.var(error[half:] - phi[half:, :used] @ w))


def _flow_residual(ref: Any, prediction: Prediction, flow: Floats) -> Floats:
    """Fit F' = g0 + g1 f and return r2, NaN where it is not measured or masked."""
    valid = ~np.isnan(prediction.f) & ~np.isnan(flow)
    fit = valid & ~prediction.masked
    ref['g1'] = 1.0
    if fit.sum() > 10:
        weight = 1.0 / prediction.sq[fit]
        design = np.column_stack([np.ones(fit.sum()), prediction.f[fit]]) * weight[:, None]
        ref['g0'], ref['g1'] = np.linalg.lstsq(design, flow[fit] * weight, rcond=None)[0]
    r2 = (flow - ref['g0'] - ref['g1'] * prediction.f) / prediction.sq
    return np.where(valid & ~prediction.masked, r2, np.nan)


def _slow_flow_sigma(
    ref: Any, settings: ScadaSettings, prediction: Prediction, samples: Floats
) -> float:
    """
    Return the sigma of r2 that a sum over many samples shows, by theory.

    The pressure filter cuts the variance of the noise to the share c, but has a gain of 1 for
    what is slow: there the variance is that of the sensors.
    """
    drop = np.maximum(samples[:, 3] - samples[:, 4], 0.02)
    share = (settings.sigma * prediction.f / (2.0 * drop) / prediction.sq) ** 2
    fit = ~np.isnan(share) & ~prediction.masked
    if not fit.any():
        return 1.0
    passed = 2.0 - float(ref['pressure']['c'].sum())
    return math.sqrt(1.0 + passed * float(share[fit].mean()))


def _limits(
    ref: Any, settings: ScadaSettings, values: tuple[Floats, ...], slow: float, wandering: bool
) -> None:
    """Set mu, sigma, allowance and limit of every CUSUM from the budget."""
    n = len(values[R1])
    arl = arl_per_test(settings)
    for i, test in enumerate(TESTS):
        r = values[test.residual]
        r = r[~np.isnan(r)]
        margin = test.wandering if wandering else test.margin
        if r.size < 200 or not margin > 0.0:
            continue
        sd = block_sigma(r, 1)
        if test.residual == R2 and test.block == SLOW:
            sd *= slow
        sd = max(sd, block_sigma(r, test.block))
        if not sd > 0.0:  # an input without any noise: nothing to test
            continue
        mu = r.mean()
        if test.k0 == 4.0:
            quantile = NormalDist().inv_cdf(1.0 - 0.25 / n)
            sd *= max(1.0, float(np.abs(r - mu).max()) / sd / quantile)
        k = test.k0 + STANDARD_ERRORS[test.block] / math.sqrt(r.size)
        clip = test.clip
        if (wandering or n < LONG_RECORD) and test.residual == R1 and test.k0 == 4.0:
            clip = JUMP_CLIP
        largest = cusum_maximum((r - mu) / sd, k, clip)
        ref['mu'][i], ref['sd'][i], ref['k'][i], ref['clip'][i] = mu, sd, k, clip
        ref['h'][i] = max(margin * siegmund_limit(k, arl), HEAD_ROOM * largest)


def _stationary(values: Floats) -> bool:
    """Tell whether an input has no slow component, so that its mean can be tested."""
    sigma = block_sigma(values, 1)
    blocks = values.size // 30
    return bool(block_sigma(values, 30) <= sigma * (STATIONARY + 1.0 / math.sqrt(blocks)))


def arl_per_test(settings: ScadaSettings) -> float:
    """Return the mean samples between false alarms each one-sided test may have."""
    tests = 2 * len(TESTS) + 1
    return settings.days_per_false_alarm * DAY_S / settings.period_s * tests


def _friction_limit(
    ref: Any, settings: ScadaSettings, r1: Floats, prediction: Prediction, wandering: bool
) -> None:
    s1 = float(r1.std())
    kap2 = max(1.0, (block_sigma(r1, 5) / s1) ** 2)
    wide = (r1 + prediction.xm - prediction.xd) / s1
    gain = ((r1 / s1) ** 2 - wide**2) / (2.0 * kap2)
    ref['s1'], ref['kap2'] = s1, kap2
    ref['llr_limit'] = max(
        LLR_MARGINS[wandering] * math.log(arl_per_test(settings)),
        LLR_HEAD_ROOM * _llr_maximum(gain),
    )
