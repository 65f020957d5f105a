# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Learn the reference of one valve from a fault-free record: models, bias, sigmas, limits."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.jit import jit
from damadics_fd.core.scada.judging.cusum import R1
from damadics_fd.core.scada.judging.limits import friction_limit, is_stationary, set_limits
from damadics_fd.core.scada.judging.predict import predict
from damadics_fd.core.scada.judging.pressure import learn_pressure
from damadics_fd.core.scada.judging.residuals import residuals
from damadics_fd.core.scada.laws.clean import despiked, period_of, split
from damadics_fd.core.scada.laws.fit_flow import FlowFit, better_medium
from damadics_fd.core.scada.laws.fit_stem import Piece, StemFit, fit_stem
from damadics_fd.core.scada.laws.plausible import LearningError, check_flow, check_stem
from damadics_fd.core.scada.laws.robust import Floats, huber_weights, loss_of, spread_of
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import (
    BASIC_WEIGHTS,
    LAW,
    MONITOR,
    N_RESIDUALS,
    N_WEIGHTS,
    NOMINAL,
    REFERENCE,
)

RIDGE = 1e-4
EARNED = 0.9  # the further regressors must cut the variance of the second half to this share
STATED = 0.8  # share to which the stated actuator must cut the variance of an identified law
# ... or equal it and leave no more than the sensors' noise
NEARLY, SENSOR = 1.1, 1.5
LEAST_SAMPLES = 200
OFF = 1e9  # a limit that is never reached
NEVER = 9.0  # a change of CV, which is 0..1, is never as large
JUMPS = (0.05, 3.0)  # a jump of CV is more than this, and than this times the largest learned
STATED_FLOW = (1.5, 0.1, 0.05)  # sigma, gain and offset with which the stated flow law is right
PILED = 10  # samples at one highest value: the end of the meter's range
SWING = (0.25, 2.0)  # of the pressure drop, of the largest change learned
T, CV, X, PRESSURE_1, PRESSURE_2, TEMPERATURE, FLOW = range(7)

__all__ = ['LearningError', 'learn']


@dataclass(frozen=True)
class Prediction:
    """Stated models and regressors over a record, one row per sample."""

    phi: Floats
    xm: Floats
    xd: Floats
    f: Floats
    sq: Floats
    f_model: Floats
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
        residuals(s, reference[0], r[2], r[3], r[4], r[5], r[6])
        phi[i, :] = s.phi
        models[i, 0] = s.xm[0]
        models[i, 1] = s.xd
        models[i, 2] = s.f
        models[i, 3] = s.sq
        models[i, 4] = s.f_model
        models[i, 5] = 1.0 if s.masked else 0.0
        for k in range(N_RESIDUALS):
            models[i, 6 + k] = s.residual[k] if s.testable[k] > 0 else math.nan


def learn(
    samples: Floats,
    settings: ScadaSettings,
    until: float | None = None,
    notes: list[str] | None = None,
) -> np.ndarray:
    """
    Return the reference learned from a fault-free record (sheet section 1.3).

    :param samples: rows t (s), CV, X', P1', P2', T1', F' (0..1, NaN where not measured), from
        the start of the record on.
    :param settings: the window to learn from, the budget, the actuator.
    :param until: end of the window since the start, s; that of the settings by default.
    :param notes: receives what a person should know about what was learned.
    :return: structured array of `REFERENCE`, length 1.
    :raises LearningError: for a record that is too short, in which the valve hardly moves or that
        does not look like a valve that works.
    """
    t = samples[:, T] - samples[0, T]
    window = (t >= settings.learn_from_s) & (t < (settings.learn_s if until is None else until))
    n = int(window.sum())
    if n < LEAST_SAMPLES:
        raise LearningError(
            f'{n} samples after {settings.learn_from_s:g} s: record {LEAST_SAMPLES} or more'
        )
    clean = despiked(samples)
    part = clean[window]
    reference = np.zeros(1, REFERENCE)
    ref = reference[0]
    ref['n'], ref['period'], ref['seconds'] = n, period_of(samples[:, T]), np.ptp(part[:, T])
    with np.errstate(all='ignore'):
        measured = np.isfinite(part).mean(axis=0) > 0.5
    ref['signals'] = int(sum(1 << i for i in range(7) if measured[i]))
    for i in np.flatnonzero(measured):
        ref['low'][i], ref['high'][i] = np.nanmin(part[:, i]), np.nanmax(part[:, i])
    pieces = _pieces(part, settings, float(ref['period']))
    identified = fit_stem(pieces, float(ref['period']))
    check_stem(identified, part[:, CV], part[:, X])
    ref['stem_law'] = identified.law[0]
    pressures = bool(measured[PRESSURE_1] and measured[PRESSURE_2])
    wandering = True
    prediction = None
    if pressures:
        _learn_inputs(ref, reference, part, settings)
        prediction = _choose_stem(ref, reference, clean, part, settings, window, identified)
        wandering = not all(is_stationary(v) for v in part[:, 3:6].T if not np.isnan(v).all())
    else:
        ref['stem_kind'] = LAW
        ref['w'][:] = 0.0
        ref['cv_jump'] = NEVER
    _choose_flow(ref, part, settings, identified, prediction, notes)
    if ref['stem_kind'] == LAW or ref['flow_kind'] == LAW:
        wandering = True
    values = _residuals(clean, settings, reference, window)
    sigma = np.full(N_RESIDUALS, np.nan)
    if ref['stem_kind'] == LAW:
        sigma[R1] = max(identified.sigma, 1e-4)
    slow = _slow_flow_sigma(ref, settings, prediction, part)
    set_limits(ref, settings, values, sigma, slow, wandering)
    if ref['stem_kind'] == NOMINAL and prediction is not None:
        friction_limit(ref, settings, values[:, R1], prediction.xm - prediction.xd, wandering)
    else:
        ref['s1'], ref['kap2'], ref['llr_limit'] = sigma[R1], 1.0, OFF
    return reference


def _pieces(part: Floats, settings: ScadaSettings, period: float) -> list[Piece]:
    return [
        Piece(piece[:, T], piece[:, CV], piece[:, X])
        for piece in split(part, max(settings.gap_s, 5.0 * period))
    ]


def _learn_inputs(ref: Any, reference: np.ndarray, part: Floats, settings: ScadaSettings) -> None:
    """Learn the pressure filters and how far the pressures move by themselves."""
    drop = part[:, PRESSURE_1] - part[:, PRESSURE_2]
    ref['dp_mean'] = ref['drop'] = float(np.nanmean(drop))
    share, factor = SWING
    for i, column in enumerate((PRESSURE_1, PRESSURE_2)):
        values = part[:, column]
        finite = values[np.isfinite(values)]
        learn_pressure(finite, settings.sigma, ref['pressure'][i : i + 1])
        swing = float(np.quantile(np.abs(finite - np.median(finite)), 0.995))
        ref['swing'][i] = max(share * abs(float(ref['drop'])), factor * swing)


def _choose_stem(
    ref: Any,
    reference: np.ndarray,
    clean: Floats,
    part: Floats,
    settings: ScadaSettings,
    window: np.ndarray,
    identified: StemFit,
) -> Prediction:
    """Take the stated actuator or the identified law: what predicts the second half better."""
    x = part[:, X]
    ref['stem_kind'] = NOMINAL
    candidates = [_predict(clean, settings, reference, window, hold) for hold in (False, True)]
    best, hold, used = min(
        (_held_out(c.phi, x - c.xm, used) / earned, hold, used)
        for hold, c in enumerate(candidates)
        for used, earned in ((BASIC_WEIGHTS, 1.0), (N_WEIGHTS, EARNED))
    )
    ref['hold'] = hold > 0
    smallest, factor = JUMPS
    largest = float(np.abs(np.diff(part[:, CV])).max())
    ref['cv_jump'] = NEVER if hold else max(smallest, factor * largest)
    prediction = candidates[hold]
    ref['w'][:used], _ = _bias(prediction.phi, x - prediction.xm, used)
    ref['x_mean'], ref['x_sd'] = prediction.xm.mean(), max(prediction.xm.std(), 1e-3)
    half = len(x) // 2
    of_law = loss_of(identified.error[half:])
    as_good = best < NEARLY * of_law and math.sqrt(best) < SENSOR * settings.sigma
    if (best > STATED * of_law and not as_good) or abs(ref['w'][1]) > STATED_FLOW[1] / 2.0:
        ref['stem_kind'] = LAW
        ref['w'][:] = 0.0
        ref['cv_jump'] = NEVER
    return prediction


def _predict(
    samples: Floats, settings: ScadaSettings, reference: np.ndarray, window: np.ndarray, hold: bool
) -> Prediction:
    trial = reference.copy()
    trial['hold'] = hold
    trial['x_sd'] = trial['f_sd'] = 1.0
    phi = np.empty((len(samples), N_WEIGHTS))
    models = np.empty((len(samples), 6 + N_RESIDUALS))
    _predict_record(np.zeros(1, MONITOR), settings.record(), trial, samples, phi, models)
    phi, models = phi[window], models[window]
    xm, xd, f, sq, f_model, masked = models[:, :6].T
    return Prediction(phi, xm, xd, f, sq, f_model, masked > 0)


def _residuals(
    samples: Floats, settings: ScadaSettings, reference: np.ndarray, window: np.ndarray
) -> Floats:
    """Return the residuals of the record as the monitor will see them, NaN where not testable."""
    phi = np.empty((len(samples), N_WEIGHTS))
    models = np.empty((len(samples), 6 + N_RESIDUALS))
    _predict_record(np.zeros(1, MONITOR), settings.record(), reference, samples, phi, models)
    residuals: Floats = models[window][:, 6:]
    return residuals


def _bias(phi: Floats, error: Floats, used: int) -> tuple[Floats, Floats]:
    """Return robust ridge weights of the first `used` regressors and what they leave."""
    design = phi[:, :used]
    ridge = RIDGE * len(error) * np.eye(used)
    ridge[0, 0] = 0.0
    weight = np.ones(len(error))
    w = np.zeros(used)
    for _ in range(3):
        scaled = design * weight[:, None]
        w = np.asarray(np.linalg.solve(design.T @ scaled + ridge, scaled.T @ error), np.float64)
        weight = np.minimum(1.0, 2.0 * huber_weights(error - design @ w))
    left: Floats = error - design @ w
    return w, left


def _held_out(phi: Floats, error: Floats, used: int) -> float:
    half = len(error) // 2
    w, _ = _bias(phi[:half], error[:half], used)
    left = error[half:] - phi[half:, :used] @ w
    return loss_of(left)


def _choose_flow(
    ref: Any,
    part: Floats,
    settings: ScadaSettings,
    identified: StemFit,
    prediction: Prediction | None,
    notes: list[str] | None,
) -> None:
    """Take the stated flow law where it is right, else an identified one."""
    flow = part[:, FLOW]
    ref['flow_kind'], ref['g1'], ref['f_sd'] = NOMINAL, 1.0, 1.0
    if not np.isfinite(flow).any():
        return
    ref['flow_max'] = float(np.nanquantile(flow, 0.999))
    flow_range = settings.flow_range
    if flow_range is None:
        flow_range = _end_of_range(flow)
    stated = prediction is not None and _stated_flow(ref, prediction, flow)
    if prediction is None:
        return
    pressures = (part[:, PRESSURE_1], part[:, PRESSURE_2], part[:, TEMPERATURE])
    if not stated:
        fit = better_medium(
            part[:, T],
            part[:, X],
            identified.x[:, 0],
            pressures,
            flow,
            flow_range,
            settings.medium,
        )
        if fit is None:
            ref['flow_law']['range'] = flow_range
            return
        ref['flow_law'] = fit.law[0]
        ref['flow_kind'] = LAW
        _tell(fit, notes)
    ref['flow_law']['range'] = flow_range
    check_flow(ref, settings)


def _end_of_range(flow: Floats) -> float:
    """
    Return the end of the flow meter's range, scaled; 0 where the record does not show it.

    A meter at its end shows one value again and again. One that never was there, and no more than
    the benchmark's 40 t/h, is taken to reach to these.
    """
    top = float(np.nanmax(flow))
    if np.count_nonzero(flow >= top * (1.0 - 1e-9)) >= PILED:
        return top
    return 1.0 if top <= 1.0 else 0.0


def _tell(fit: FlowFit, notes: list[str] | None) -> None:
    if notes is not None:
        spread = 100.0 * float(fit.law['spread'][0])
        notes.append(f'flow characteristic identified from {fit.used} samples, +-{spread:.1f} %')


def _stated_flow(ref: Any, prediction: Prediction, flow: Floats) -> bool:
    """
    Fit F' = g0 + g1 f and tell whether the stated flow law is right.

    f carries the noise of X', so least squares would find too small a g1; the flow at the model's
    position does not share that noise and is the instrument.
    """
    fit = np.isfinite(prediction.f + prediction.f_model + flow) & ~prediction.masked
    if fit.sum() < LEAST_SAMPLES // 2:
        return bool(np.isfinite(prediction.f).any() and float(np.nanmax(flow)) <= 1.0)
    f, y, sq = prediction.f[fit], flow[fit], prediction.sq[fit]
    instrument = prediction.f_model[fit]
    one = np.ones(len(f))
    weight = 1.0 / sq**2
    g = np.zeros(2)
    left = y
    for _ in range(4):
        z = np.column_stack([one, instrument]) * weight[:, None]
        normal = z.T @ np.column_stack([one, f])
        g = np.asarray(np.linalg.lstsq(normal, z.T @ y, rcond=None)[0], np.float64)
        left = (y - g[0] - g[1] * f) / sq
        weight = np.minimum(1.0, 2.0 * huber_weights(left)) / sq**2
    ref['g0'], ref['g1'] = g
    ref['f_mean'], ref['f_sd'] = instrument.mean(), max(instrument.std(), 1e-3)
    sigma, gain, offset = STATED_FLOW
    error = 3.0 * spread_of(left * sq) / (math.sqrt(len(f)) * float(ref['f_sd']))
    off = abs(g[0] + (g[1] - 1.0) * float(ref['f_mean']))
    right: bool = (
        spread_of(left) <= sigma
        and abs(g[1] - 1.0) <= gain + error
        and off <= offset
        and float(np.nanmax(flow)) <= 1.0 + 1e-9
    )
    if right and abs(g[1] - 1.0) > gain:  # the record does not tell the gain: keep the stated one
        ref['g1'] = 1.0
        ref['g0'] = float(np.median(y - f))
    return right


def _slow_flow_sigma(
    ref: Any, settings: ScadaSettings, prediction: Prediction | None, part: Floats
) -> float:
    """
    Return the sigma of r2 that a sum over many samples shows, by theory.

    The pressure filter cuts the variance of the noise to the share c, but has a gain of 1 for
    what is slow: there the variance is that of the sensors.
    """
    if prediction is None or ref['flow_kind'] == LAW:
        return 1.0
    drop = np.maximum(part[:, PRESSURE_1] - part[:, PRESSURE_2], 0.02)
    share = (settings.sigma * prediction.f / (2.0 * drop) / prediction.sq) ** 2
    fit = ~np.isnan(share) & ~prediction.masked
    if not fit.any():
        return 1.0
    passed = 2.0 - float(ref['pressure']['c'].sum())
    return math.sqrt(1.0 + passed * float(share[fit].mean()))
