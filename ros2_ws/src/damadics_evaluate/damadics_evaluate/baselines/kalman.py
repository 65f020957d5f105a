# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Extended Kalman filters: innovation test, and friction and spring as states (filterpy)."""

import math
from typing import Any

import numpy as np
from damadics_fd.core.scada.actuator import nominal_flow
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.plug import RECOVERY, recovery

from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import CV, P1, P2, T1, Detector, F, X, require

ACT = Valve()
KM = np.array(RECOVERY)


class InnovationEkf(Detector):
    """
    Normalised innovation squared of an EKF on X' and F', averaged over a window.

    The stem is x(k) = w0 + w1 x(k-1) + w2 CV(k) + w3 CV(k-1), fitted to the fault-free hour, with
    a slowly varying bias as second state; F' is the nominal valve equation.
    """

    name, title = 'ekf', 'EKF innovation (filterpy)'

    def __init__(self, window: int = 5, bias_noise: float = 1e-5) -> None:
        self.window = window
        self.bias_noise = bias_noise
        self._record = ACT.record()[0]

    def fit(self, hour: Floats) -> None:
        """Fit stem dynamics and noise."""
        rows = self.learning_rows(hour)
        design = np.column_stack(
            [np.ones(len(rows) - 1), rows[:-1, X], rows[1:, CV], rows[:-1, CV]]
        )
        self._w = np.linalg.lstsq(design, rows[1:, X], rcond=None)[0]
        error = rows[1:, X] - design @ self._w
        self._q = float(error.var())
        f = np.array([self._flow(*row) for row in rows[:, (X, P1, P2, T1)]])
        self._r = np.diag([0.2 * self._q, float(np.nanvar(rows[:, F] - f))])
        self._offset = float(np.nanmean(rows[:, F] - f))

    def _flow(self, x: float, p1: float, p2: float, t1: float) -> float:
        return float(nominal_flow(self._record, x, p1, p2, t1))

    def statistic(self, samples: Floats) -> Floats:
        """Return the windowed mean of the normalised innovation squared."""
        kalman = require('filterpy.kalman', self.name)
        ekf = kalman.ExtendedKalmanFilter(2, 2)
        ekf.x = np.array([[samples[0, X]], [0.0]])
        ekf.P = np.diag([self._q, 1e-6])
        ekf.F = np.array([[self._w[1], 1.0], [0.0, 1.0]])
        ekf.Q = np.diag([self._q, self.bias_noise**2])
        ekf.R = self._r
        nis = np.zeros(len(samples))
        drive = self._w[0] + self._w[2] * samples[1:, CV] + self._w[3] * samples[:-1, CV]
        for i in range(1, len(samples)):
            row = samples[i]
            x = self._w[1] * ekf.x[0, 0] + ekf.x[1, 0] + drive[i - 1]
            bias = ekf.x[1, 0]
            ekf.x = np.array([[x], [bias]])
            ekf.P = ekf.F @ ekf.P @ ekf.F.T + ekf.Q
            inputs = float(row[P1]), float(row[P2]), float(row[T1])
            f = self._flow(x, *inputs)
            slope = (self._flow(x + 0.01, *inputs) - self._flow(x - 0.01, *inputs)) / 0.02
            jacobian = np.array([[1.0, 0.0], [slope, 0.0]])
            expected = np.array([[x], [f + self._offset]])
            ekf.update(
                np.array([[row[X]], [row[F]]]),
                lambda _, j=jacobian: j,
                lambda _, h=expected: h,
            )
            nis[i] = float((ekf.y.T @ ekf.SI @ ekf.y)[0, 0])
        mean = np.convolve(nis, np.full(self.window, 1.0 / self.window))[: len(nis)]
        return np.where(self.active(samples), mean, 0.0)


class FrictionSpringEkf:
    """
    EKF with friction force and spring change as states, where the force is measured.

    State [x, fr, s]: position and friction over K L, spring change. The stem without mass moves
    with v = g (U - (1+s) x - fr tanh(v / v_s)); U is the force from chamber pressure and plug.
    The statistic is the largest departure of fr or s from what the fault-free part showed.

    :param dt: sample period, s.
    """

    name, title = 'ekf_states', 'EKF with friction and spring states (filterpy)'

    def __init__(self, dt: float, v_s: float = 0.02, drift: float = 2e-3) -> None:
        self.dt = dt
        self.v_s = v_s
        self.drift = drift
        self._g = ACT.stiffness / ACT.viscous

    def force(self, columns: dict[str, Floats]) -> Floats:
        """Return u / (K L) from the measured chamber pressure, pressures and position."""
        plug = np.array([recovery(KM, x) for x in columns['x1']])
        drop = (columns['p1'] - columns['p2']) * ACT.signed_plug_area / plug
        force = ACT.mass * ACT.gravity + ACT.area * columns['ps'] - drop
        return np.asarray(force / ACT.force_scale)

    def estimates(self, columns: dict[str, Floats], sigma: float) -> Floats:
        """
        Return the estimates of friction and spring change, one row per sample.

        :param columns: cv, x1, p1, p2, ps of a run.
        :param sigma: standard deviation of the position sensor.
        :return: shape (n, 2).
        """
        kalman: Any = require('filterpy.kalman', self.name)
        force = self.force(columns)
        ekf = kalman.ExtendedKalmanFilter(3, 1)
        ekf.x = np.array([[columns['x1'][0] + 0.25], [0.0], [0.0]])
        ekf.P = np.diag([sigma**2, 1e-4, 1e-4])
        q = self.drift**2 * self.dt
        ekf.Q = np.diag([(2.0 * sigma) ** 2 * self.dt, q, q])
        ekf.R = np.array([[sigma**2]])
        jacobian = np.array([[1.0, 0.0, 0.0]])
        out = np.zeros((len(force), 2))
        v = 0.0
        for i, u in enumerate(force.tolist()):
            x, fr, s = ekf.x[:, 0]
            v, slip = self._velocity(u, x, fr, s, v)
            d = 1.0 + self._g * fr * (1.0 - slip**2) / self.v_s
            moving = 0.0 < x - 0.25 < 1.0 or (x <= 0.25 and v > 0) or (x >= 1.25 and v < 0)
            ekf.x = np.array([[x + self.dt * v if moving else x], [fr], [s]])
            step = np.eye(3)
            if moving:
                step[0] = self.dt * self._g / d * np.array([-(1.0 + s), -slip, -x])
                step[0, 0] += 1.0
            ekf.P = step @ ekf.P @ step.T + ekf.Q
            seen = columns['x1'][i] + 0.25
            ekf.update(np.array([[seen]]), lambda _: jacobian, lambda state: state[:1])
            ekf.x[1, 0] = max(ekf.x[1, 0], 0.0)
            out[i] = ekf.x[1, 0], ekf.x[2, 0]
        return out

    def _velocity(
        self, u: float, x: float, fr: float, s: float, start: float
    ) -> tuple[float, float]:
        """Solve v = g (u - (1+s) x - fr tanh(v / v_s)), monotone in v, by bracketed Newton."""
        push = self._g * (u - (1.0 + s) * x)
        low, high = sorted((push - self._g * fr, push + self._g * fr))
        v = min(max(start, low), high)
        slip = 0.0
        for _ in range(30):
            slip = math.tanh(v / self.v_s)
            error = v - push + self._g * fr * slip
            if error > 0:
                high = v
            else:
                low = v
            if abs(error) < 1e-9:
                break
            v -= error / (1.0 + self._g * fr * (1.0 - slip**2) / self.v_s)
            if not low < v < high:
                v = 0.5 * (low + high)
        return v, slip

    def statistic(self, columns: dict[str, Floats], sigma: float, learn: slice) -> Floats:
        """
        Return the departure of friction or spring from the fault-free part, in its sigmas.

        :param columns: a run.
        :param sigma: standard deviation of the position sensor.
        :param learn: samples of the fault-free part.
        :return: one value per sample.
        """
        states = self.estimates(columns, sigma)
        mean = states[learn].mean(axis=0)
        spread = np.maximum(states[learn].std(axis=0), 1e-3)
        return np.asarray((np.abs(states - mean) / spread).max(axis=1))
