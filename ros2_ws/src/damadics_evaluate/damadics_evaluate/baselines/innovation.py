# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Innovation test of an extended Kalman filter on position and flow."""

import numpy as np
from damadics_fd.core.jit import jit
from damadics_fd.core.scada.laws.actuator import nominal_flow
from damadics_fd.core.valve.parameters import Valve

from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import CV, P1, P2, T1, Detector, F, X

STEP = 0.01  # of the position, for the slope of the flow
BIAS_VARIANCE = 1e-6  # of the bias at the start


@jit
def _flows(valve: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    out = np.empty(len(inputs))
    for i in range(len(inputs)):
        x, p1, p2, t1 = inputs[i]
        out[i] = nominal_flow(valve[0], x, p1, p2, t1)
    return out


@jit
def _innovations(
    valve: np.ndarray,
    rows: np.ndarray,
    w: np.ndarray,
    q: np.ndarray,
    r: np.ndarray,
    offset: float,
) -> np.ndarray:
    """
    Return the normalised innovation squared of every row (t, CV, X', P1', P2', T1', F').

    States: position and bias. A flow that is not measured is left out of the update.
    """
    n = len(rows)
    nis = np.zeros(n)
    x, bias = rows[0, 2], 0.0
    pxx, pxb, pbb = q[0], 0.0, BIAS_VARIANCE
    for i in range(1, n):
        x = w[1] * x + bias + w[0] + w[2] * rows[i, 1] + w[3] * rows[i - 1, 1]
        pxx = w[1] * w[1] * pxx + 2.0 * w[1] * pxb + pbb + q[0]
        pxb = w[1] * pxb + pbb
        pbb += q[1]
        p1, p2, t1 = rows[i, 3], rows[i, 4], rows[i, 5]
        f = nominal_flow(valve[0], x, p1, p2, t1)
        up = nominal_flow(valve[0], x + STEP, p1, p2, t1)
        down = nominal_flow(valve[0], x - STEP, p1, p2, t1)
        h = (up - down) / (2.0 * STEP)
        y0, y1 = rows[i, 2] - x, rows[i, 6] - f - offset
        if not np.isfinite(y0):
            continue
        if not np.isfinite(y1):
            h, y1 = 0.0, 0.0
        # S = H P H' + R with H = [[1, 0], [h, 0]]
        s00, s01, s11 = pxx + r[0], h * pxx, h * h * pxx + r[1]
        d = s00 * s11 - s01 * s01
        g0, g1 = (s11 * y0 - s01 * y1) / d, (s00 * y1 - s01 * y0) / d  # S^-1 y
        nis[i] = y0 * g0 + y1 * g1
        x += pxx * (g0 + h * g1)
        bias += pxb * (g0 + h * g1)
        c = (s11 - 2.0 * h * s01 + h * h * s00) / d  # [1 h] S^-1 [1 h]'
        pbb -= pxb * pxb * c
        pxb -= pxx * pxb * c
        pxx -= pxx * pxx * c
    return nis


class InnovationEkf(Detector):
    """
    Normalised innovation squared of an EKF on X' and F', averaged over a window.

    The stem is x(k) = w0 + w1 x(k-1) + w2 CV(k) + w3 CV(k-1), fitted to the fault-free hour, with
    a slowly varying bias as second state; F' is the nominal valve equation.
    """

    name, title = 'ekf', 'EKF innovation'

    def __init__(self, window: int = 5, bias_noise: float = 1e-5) -> None:
        self.window = window
        self.bias_noise = bias_noise
        self._record = Valve().record()

    def fit(self, hour: Floats) -> None:
        """Fit stem dynamics and noise."""
        rows = self.learning_rows(hour)
        design = np.column_stack(
            [np.ones(len(rows) - 1), rows[:-1, X], rows[1:, CV], rows[:-1, CV]]
        )
        self._w = np.linalg.lstsq(design, rows[1:, X], rcond=None)[0]
        error = rows[1:, X] - design @ self._w
        self._q = float(error.var())
        f = _flows(self._record, np.ascontiguousarray(rows[:, (X, P1, P2, T1)]))
        self._r = np.array([0.2 * self._q, float(np.nanvar(rows[:, F] - f))])
        self._offset = float(np.nanmean(rows[:, F] - f))

    def statistic(self, samples: Floats) -> Floats:
        """Return the windowed mean of the normalised innovation squared."""
        q = np.array([self._q, self.bias_noise**2])
        rows = np.ascontiguousarray(samples)
        nis = _innovations(self._record, rows, self._w, q, self._r, self._offset)
        mean = np.convolve(nis, np.full(self.window, 1.0 / self.window))[: len(nis)]
        return np.where(self.active(samples), mean, 0.0)
