# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Run the models over a whole record, for learning."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats
from damadics_fd.core.scada.judging.cusum import R1
from damadics_fd.core.scada.judging.predict import predict
from damadics_fd.core.scada.judging.residuals import residuals
from damadics_fd.core.scada.settings import ScadaSettings
from damadics_fd.core.scada.state import MONITOR, N_RESIDUALS, N_ROUGH, N_WEIGHTS, NOMINAL

BETWEEN = 100  # samples with the stem between its stops that tell how quiet it is


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
    rough: np.ndarray,
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
        models[i, 6 + N_RESIDUALS] = 1.0 if s.t < s.t_stop else 0.0
        rough[i] = s.rough


def predicted(
    samples: Floats, settings: ScadaSettings, reference: np.ndarray, window: np.ndarray, hold: bool
) -> Prediction:
    """Return models and regressors of the stated actuator over a record, CV held or not."""
    trial = reference.copy()
    trial['hold'] = hold
    trial['x_sd'] = trial['f_sd'] = 1.0
    phi = np.empty((len(samples), N_WEIGHTS))
    models = np.empty((len(samples), 7 + N_RESIDUALS))
    rough = np.empty((len(samples), N_ROUGH, 2))
    _predict_record(np.zeros(1, MONITOR), settings.record(), trial, samples, phi, models, rough)
    phi, models = phi[window], models[window]
    xm, xd, f, sq, f_model, masked = models[:, :6].T
    return Prediction(phi, xm, xd, f, sq, f_model, masked > 0)


def residuals_of(
    samples: Floats, settings: ScadaSettings, reference: np.ndarray, window: np.ndarray
) -> tuple[Floats, Floats]:
    """
    Return the residuals of the record as the monitor will see them, and their roughness.

    :return: residuals, NaN where not testable, shape (n, 6); roughness as it is followed.
    """
    phi = np.empty((len(samples), N_WEIGHTS))
    models = np.empty((len(samples), 7 + N_RESIDUALS))
    rough = np.empty((len(samples), N_ROUGH, 2))
    state, record = np.zeros(1, MONITOR), settings.record()
    _predict_record(state, record, reference, samples, phi, models, rough)
    values, stopped = models[window][:, 6:-1], models[window][:, -1] > 0.0
    between = np.isfinite(values[:, R1]) & ~stopped
    if reference[0]['stem_kind'] == NOMINAL and between.sum() >= BETWEEN:
        values[stopped, R1] = np.nan  # there it is what is allowed for at a stop that hides it
    return values, rough[window]
