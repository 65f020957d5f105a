# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Learn the reference of one valve from a fault-free record: models, bias, sigmas, limits."""

import math

import numpy as np

from damadics_fd.core.scada.judging.cusum import R1
from damadics_fd.core.scada.judging.gap import GAP_PERIODS
from damadics_fd.core.scada.judging.limits import (
    friction_limit,
    is_stationary,
    set_limits,
    wander_of,
)
from damadics_fd.core.scada.judging.pressure import learn_pressure
from damadics_fd.core.scada.judging.roughness import usual_roughness
from damadics_fd.core.scada.laws.choose_flow import choose_flow, slow_sigma
from damadics_fd.core.scada.laws.clean import (
    despiked,
    is_regular,
    longest_repeat,
    period_of,
    spike_sizes,
    split,
    worthwhile,
)
from damadics_fd.core.scada.laws.fit_stem import Piece, StemFit, fit_stem
from damadics_fd.core.scada.laws.plausible import (
    LearningError,
    check_residual,
    check_stem,
    possible,
)
from damadics_fd.core.scada.laws.robust import Floats, effective, huber_weights, loss_of
from damadics_fd.core.scada.prediction import Prediction, predicted, residuals_of
from damadics_fd.core.scada.samples import CV, PRESSURE_1, PRESSURE_2, T, X
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import (
    BASIC_WEIGHTS,
    LAW,
    N_RESIDUALS,
    N_WEIGHTS,
    NOMINAL,
    REFERENCE,
    Reference,
)

RIDGE = 1e-4
EARNED = 0.9  # the further regressors must cut the variance of the second half to this share
STATED = 0.8  # share to which the stated actuator must cut the variance of an identified law
# ... or equal it and leave no more than the sensors' noise
NEARLY, SENSOR = 1.1, 1.5
LEAST_SAMPLES = 200
NOTHING = 1e-14  # of the stroke, squared: a model without error
STEP, MOST_STEPS = 0.02, 8  # of its logarithm, with which the air is looked for
USUAL_AIR = 0.02  # deviation of its logarithm before anything is seen: a plant of two hours
PUSHED = 0.02  # gain of the bias beyond which the actuator is another one
# of the stroke: a stem that hardly moves shows neither gain nor air, but a shift
QUIET, SHIFTED = 0.02, 0.005
OFF = 1e9  # a limit that is never reached
NEVER = 9.0  # a change of CV, which is 0..1, is never as large
JUMPS = (0.05, 3.0)  # a jump of CV is more than this, and than this times the largest learned
SWING = (0.5, 2.0)  # of the pressure drop, of the largest change learned

__all__ = ['LearningError', 'learn']


def learn(
    samples: Floats,
    settings: ScadaSettings,
    until: float | None = None,
    notes: list[str] | None = None,
) -> np.ndarray:
    """
    Return the reference learned from a fault-free record.

    :param samples: rows t (s), CV, X', P1', P2', T1', F' (0..1, NaN where not measured), from
        the start of the record on.
    :param settings: the window to learn from, the budget, the actuator.
    :param until: end of the window since the start, s; that of the settings by default.
    :param notes: receives what a person should know about what was learned.
    :return: structured array of `REFERENCE`, length 1.
    :raises LearningError: for a record that is too short, in which the valve hardly moves or that
        does not look like a valve that works.
    """
    try:
        return _learned(possible(samples), settings, until, notes)
    except np.linalg.LinAlgError as problem:
        raise LearningError(
            f'the record cannot be fitted ({problem}): look for values that no valve has'
        ) from problem


def _learned(
    samples: Floats, settings: ScadaSettings, until: float | None, notes: list[str] | None
) -> np.ndarray:
    t = samples[:, T] - samples[0, T]
    window = (t >= settings.learn_from_s) & (t < (settings.learn_s if until is None else until))
    gap = max(settings.gap_s, GAP_PERIODS * period_of(samples[:, T]))
    window[window] = worthwhile(t[window], gap)
    n = int(window.sum())
    if n < LEAST_SAMPLES:
        raise LearningError(
            f'{n} samples after {settings.learn_from_s:g} s: record {LEAST_SAMPLES} or more'
        )
    clean = despiked(samples)
    part = clean[window]
    reference = np.zeros(1, REFERENCE)
    ref = reference[0]
    ref.regular = is_regular(samples[:, T])
    ref.spike[:] = spike_sizes(clean)
    ref.longest_repeat = longest_repeat(samples[window])
    ref.n, ref.period, ref.seconds = n, period_of(samples[:, T]), np.ptp(part[:, T])
    with np.errstate(all='ignore'):
        measured = np.isfinite(part).mean(axis=0) > 0.5
    ref.signals = int(sum(1 << i for i in range(7) if measured[i]))
    for i in np.flatnonzero(measured):
        ref.low[i], ref.high[i] = np.nanmin(part[:, i]), np.nanmax(part[:, i])
    pieces = _pieces(part, settings, float(ref.period))
    identified = fit_stem(pieces, float(ref.period))
    check_stem(identified, part[:, CV], part[:, X])
    ref.stem_law = identified.law[0]
    pressures = bool(measured[PRESSURE_1] and measured[PRESSURE_2])
    wandering = True
    prediction = None
    if pressures:
        _learn_inputs(ref, part, settings)
        prediction = _choose_stem(ref, reference, clean, part, settings, window, identified)
        wandering = not all(is_stationary(v) for v in part[:, 3:6].T if not np.isnan(v).all())
    else:
        ref.stem_kind = LAW
        ref.w[:] = 0.0
        ref.cv_jump = NEVER
    choose_flow(ref, part, settings, identified, prediction, notes)
    if ref.stem_kind == LAW or ref.flow_kind == LAW:
        wandering = True
    values, rough = residuals_of(clean, settings, reference, window)
    if ref.stem_kind == NOMINAL:
        check_residual(values[:, R1])
    ref.rough[:] = usual_roughness(rough)
    sigma = np.full(N_RESIDUALS, np.nan)
    if ref.stem_kind == LAW:
        sigma[R1] = max(identified.sigma, 1e-4)
        ref.wander = wander_of(values[:, R1])
    slow = slow_sigma(ref, settings, prediction, part)
    set_limits(ref, settings, values, sigma, slow, wandering)
    if ref.stem_kind == NOMINAL and prediction is not None:
        xm, wider = prediction.xm, prediction.xm - prediction.xd
        friction_limit(ref, settings, values[:, R1], xm, wider, wandering)
    else:
        ref.s1, ref.kap2, ref.llr_limit = sigma[R1], 1.0, OFF
    return reference


def _pieces(part: Floats, settings: ScadaSettings, period: float) -> list[Piece]:
    return [
        Piece(piece[:, T], piece[:, CV], piece[:, X])
        for piece in split(part, max(settings.gap_s, GAP_PERIODS * period))
    ]


def _learn_inputs(ref: Reference, part: Floats, settings: ScadaSettings) -> None:
    """Learn the pressure filters and how far the pressures move by themselves."""
    drop = part[:, PRESSURE_1] - part[:, PRESSURE_2]
    ref.dp_mean = ref.drop = float(np.nanmean(drop))
    share, factor = SWING
    for i, column in enumerate((PRESSURE_1, PRESSURE_2)):
        values = part[:, column]
        finite = values[np.isfinite(values)]
        learn_pressure(finite, settings.sigma, ref.pressure[i])
        swing = float(np.quantile(np.abs(finite - np.median(finite)), 0.995))
        ref.swing[i] = max(share * abs(float(ref.drop)), factor * swing)


def _choose_stem(
    ref: Reference,
    reference: np.ndarray,
    clean: Floats,
    part: Floats,
    settings: ScadaSettings,
    window: np.ndarray,
    identified: StemFit,
) -> Prediction:
    """Take the stated actuator or the identified law: what predicts the second half better."""
    x = part[:, X]
    ref.stem_kind = NOMINAL
    candidates = [predicted(clean, settings, reference, window, hold) for hold in (False, True)]
    best, hold, used = min(
        (_held_out(c.phi, x - c.xm, used) / earned, hold, used)
        for hold, c in enumerate(candidates)
        for used, earned in ((BASIC_WEIGHTS, 1.0), (N_WEIGHTS, EARNED))
    )
    ref.hold = hold > 0
    smallest, factor = JUMPS
    largest = float(np.abs(np.diff(part[:, CV])).max())
    shown = hold and largest > smallest  # small changes do not tell when CV came
    ref.cv_jump = NEVER if shown else max(smallest, factor * largest)
    prediction = candidates[hold]
    ref.w[:used], _ = _bias(prediction.phi, x - prediction.xm, used)
    ref.x_mean, ref.x_sd = prediction.xm.mean(), max(prediction.xm.std(), 1e-3)
    half = len(x) // 2
    of_law = loss_of(identified.error[half:])
    as_good = best < NEARLY * of_law and math.sqrt(best) < SENSOR * settings.sigma
    shifted = abs(float(np.mean(prediction.phi[:, :used] @ ref.w[:used])))
    elsewhere = shifted > SHIFTED and float(ref.x_sd) < QUIET
    if (best > STATED * of_law and not as_good) or abs(ref.w[1]) > PUSHED or elsewhere:
        ref.stem_kind = LAW
        ref.w[:] = 0.0
        ref.cv_jump = NEVER
        return prediction
    if float(ref.x_sd) < QUIET:
        return prediction
    return _fit_air(ref, reference, clean, x, settings, window, prediction, used)


def _fit_air(
    ref: Reference,
    reference: np.ndarray,
    clean: Floats,
    x: Floats,
    settings: ScadaSettings,
    window: np.ndarray,
    prediction: Prediction,
    used: int,
) -> Prediction:
    """
    Fit the air with which the stated stem starts: the likeliest by what it leaves of r1.

    A plant may have been running for long, and noise of the pressures makes a stem with more air
    the smoother, better one: what is looked for after a start is what differs from this. Slow
    loads do not tell the air, and what they seem to tell does not hold for others.
    """
    told = effective(_bias(prediction.phi, x - prediction.xm, used)[1])

    def cost(p: Prediction, air: float) -> float:
        left = max(loss_of(_bias(p.phi, x - p.xm, used)[1]), NOTHING)
        return 0.5 * told * math.log(left) + 0.5 * (air / USUAL_AIR) ** 2

    def at(air: float) -> tuple[float, Prediction]:
        ref.air = air
        p = predicted(clean, settings, reference, window, bool(ref.hold))
        return cost(p, air), p

    least, air = cost(prediction, 0.0), 0.0
    for _ in range(MOST_STEPS):
        before, after = at(air - STEP)[0], at(air + STEP)[0]
        further = max(_vertex(before, least, after, STEP), -air)  # running takes air, never less
        air += further
        least, prediction = at(air)
        if abs(further) < STEP:
            break
    ref.w[:used], _ = _bias(prediction.phi, x - prediction.xm, used)
    ref.x_mean, ref.x_sd = prediction.xm.mean(), max(prediction.xm.std(), 1e-3)
    return prediction


def _vertex(before: float, least: float, after: float, step: float) -> float:
    """
    Return how far from the middle one of three values their parabola is least, a step at most.

    :param step: between two of them.

    >>> round(_vertex(1.5**2, 0.5**2, 0.5**2, 1.0), 6)
    0.5
    """
    bend = before + after - 2.0 * least
    if not bend > 0.0:
        return math.copysign(step, before - after)
    return 0.5 * step * min(max((before - after) / bend, -2.0), 2.0)


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
