# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Take the stated flow law where it is right, else identify one."""

import math

import numpy as np

from damadics_fd.core.record import Floats
from damadics_fd.core.scada.laws.fit_flow import FlowFit, better_medium
from damadics_fd.core.scada.laws.fit_stem import StemFit
from damadics_fd.core.scada.laws.plausible import check_flow
from damadics_fd.core.scada.laws.robust import huber_weights, spread_of
from damadics_fd.core.scada.prediction import Prediction
from damadics_fd.core.scada.samples import FLOW, PRESSURE_1, PRESSURE_2, TEMPERATURE, T, X
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import LAW, NOMINAL, Reference

LEAST = 100  # samples that tell gain and offset
STATED_FLOW = (1.5, 0.1, 0.05)  # sigma, gain and offset with which the stated flow law is right
PILED = 10  # samples at one highest value: the end of the meter's range


def choose_flow(
    ref: Reference,
    part: Floats,
    settings: ScadaSettings,
    identified: StemFit,
    prediction: Prediction | None,
    notes: list[str] | None,
) -> None:
    """Take the stated flow law where it is right, else an identified one."""
    flow = part[:, FLOW]
    ref.flow_kind, ref.g1, ref.f_sd = NOMINAL, 1.0, 1.0
    if not np.isfinite(flow).any():
        return
    ref.flow_max = float(np.nanquantile(flow, 0.999))
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
            ref.flow_law.range = flow_range
            return
        ref.flow_law = fit.law[0]
        ref.flow_kind = LAW
        _tell(fit, notes)
    ref.flow_law.range = flow_range
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


def _stated_flow(ref: Reference, prediction: Prediction, flow: Floats) -> bool:
    """
    Fit F' = g0 + g1 f and tell whether the stated flow law is right.

    f carries the noise of X', so least squares would find too small a g1; the flow at the model's
    position does not share that noise and is the instrument.
    """
    fit = np.isfinite(prediction.f + prediction.f_model + flow) & ~prediction.masked
    if fit.sum() < LEAST:
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
    ref.g0, ref.g1 = g
    _tell_where(ref, instrument, 1.0 / sq**2)
    sigma, gain, offset = STATED_FLOW
    error = 3.0 * spread_of(left * sq) / (math.sqrt(len(f)) * float(ref.f_sd))
    off = abs(g[0] + (g[1] - 1.0) * float(ref.f_mean))
    right: bool = (
        spread_of(left) <= sigma
        and abs(g[1] - 1.0) <= gain + error
        and off <= offset
        and float(np.nanmax(flow)) <= 1.0 + 1e-9
    )
    if right and abs(g[1] - 1.0) > gain:  # the record does not tell the gain: keep the stated one
        ref.g1 = 1.0
        ref.g0 = float(np.median(y - f))
    return right


def _tell_where(ref: Reference, f: Floats, weight: Floats) -> None:
    """Keep where and by which sigma F' = g0 + g1 f was learned: away from there it is unsure."""
    ref.f_mean, ref.f_sd = f.mean(), max(f.std(), 1e-3)
    ref.f_sigma = math.sqrt(len(f) / float(weight.sum()))


def slow_sigma(
    ref: Reference, settings: ScadaSettings, prediction: Prediction | None, part: Floats
) -> float:
    """
    Return the sigma of r2 that a sum over many samples shows, by theory.

    The pressure filter cuts the variance of the noise to the share c, but has a gain of 1 for
    what is slow: there the variance is that of the sensors.
    """
    if prediction is None or ref.flow_kind == LAW:
        return 1.0
    drop = np.maximum(part[:, PRESSURE_1] - part[:, PRESSURE_2], 0.02)
    share = (settings.sigma * prediction.f / (2.0 * drop) / prediction.sq) ** 2
    fit = ~np.isnan(share) & ~prediction.masked
    if not fit.any():
        return 1.0
    passed = 2.0 - float(ref.pressure[0].c) - float(ref.pressure[1].c)
    return math.sqrt(1.0 + passed * float(share[fit].mean()))
