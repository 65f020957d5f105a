# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Extended Kalman filter with friction and spring as states (filterpy)."""

import math
from typing import Any

import numpy as np
from damadics_fd.core.valve.parameters import Valve
from damadics_fd.core.valve.plug import RECOVERY, recovery

from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import require

ACT = Valve()
KM = np.array(RECOVERY)


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
