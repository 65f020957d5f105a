# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Baselines: each statistic on signals made by hand, each detector on a step it must see."""

import sys

import numpy as np
import pytest
from damadics_evaluate.baselines import DETECTORS, MissingPackageError
from damadics_evaluate.baselines.innovation import _innovations
from damadics_evaluate.baselines.kalman import FrictionSpringEkf
from damadics_evaluate.baselines.residuals import (
    CusumOnDeviation,
    Ewma,
    Glr,
    SmartPositioner,
)
from damadics_fd.core.scada.laws.actuator import nominal_flow
from damadics_fd.core.valve.parameters import Valve

T, CV, X, P1, P2, T1, F = range(7)
LEFT_OUT = ('scada', 'fixed_r2', 'forest', 'mlp')  # learn of the plant; see the tests of their own


def record(n, seed):
    """Return a linear stem behind a slow CV, with every signal noisy."""
    rng = np.random.default_rng(seed)
    t = np.arange(float(n))
    cv = 0.5 + 0.25 * np.sin(2 * np.pi * 0.01 * t)
    x = 0.3 * np.roll(cv, 1) + 0.7 * cv
    x[0] = cv[0]
    flow = np.exp(-5 * x) * 9.0
    clean = np.column_stack([x, np.full(n, 0.875), np.full(n, 0.65), np.full(n, 0.2), flow])
    return np.column_stack([t, cv, clean + rng.normal(0, 0.0014, clean.shape)])


@pytest.mark.parametrize('name', [n for n in DETECTORS if n not in LEFT_OUT])
def test_every_baseline_reacts_to_a_stuck_stem(name):
    detector = DETECTORS[name]()
    try:
        detector.fit(record(1200, 0))
        quiet = detector.statistic(record(1000, 1))
        faulty = record(1000, 2)
        faulty[700:, X] = faulty[700, X]
        loud = detector.statistic(faulty)
    except MissingPackageError as error:
        pytest.skip(str(error))  # a library of the extra `baselines`, named with its remedy
    assert quiet.shape == loud.shape == (1000,)
    assert not quiet[:300].any()  # no test in the set-up zone
    assert np.isfinite(loud).all()
    assert loud[700:].max() > 1.05 * quiet.max()


def test_statistics_by_hand():
    z = np.array([0.0, 3.0, 3.0, 0.0])
    assert CusumOnDeviation(k=1.0)._test(z).tolist() == [0.0, 2.0, 4.0, 3.0]
    assert Ewma(weight=0.5)._test(z).tolist() == [0.0, 1.5, 2.25, 1.125]
    assert Glr(window=2)._test(z).tolist() == [0.0, 4.5, 9.0, 2.25]


def test_the_positioner_waits_for_its_monitoring_time():
    z = np.concatenate((np.zeros(50), np.full(50, 8.0)))
    statistic = SmartPositioner(filter_s=1.0, monitoring_s=20)._test(z)
    assert not statistic[:69].any()
    assert statistic[-1] == pytest.approx(8.0, rel=1e-3)


def test_a_missing_library_is_named_with_its_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, 'river.drift', None)
    with pytest.raises(MissingPackageError, match='pip install river'):
        detector = DETECTORS['adwin']()
        detector.fit(record(600, 0))
        detector.statistic(record(400, 1))


def test_the_friction_and_spring_ekf_finds_its_states():
    pytest.importorskip('filterpy')
    dt, n = 0.005, 3000
    ekf = FrictionSpringEkf(dt)
    t = np.arange(n) * dt
    friction, spring, x, v = 0.02, 0.0, 0.75, 0.0
    cv = 0.5 + 0.4 * np.sin(2 * np.pi * 0.2 * t)
    xs, force = np.empty(n), np.empty(n)
    for i in range(n):
        if t[i] >= 7.5:
            friction = 0.08
        force[i] = 0.25 + cv[i]
        v, _ = ekf._velocity(force[i], x, friction, spring, v)
        xs[i] = x - 0.25
        x += dt * v
    columns = {'x1': xs + np.random.default_rng(0).normal(0, 1e-4, n)}
    ekf.force = lambda _: force
    states = ekf.estimates(columns, sigma=1e-4)
    assert states[1400, 0] == pytest.approx(0.02, abs=0.01)
    assert states[-1, 0] == pytest.approx(0.08, abs=0.02)
    statistic = ekf.statistic(columns, 1e-4, slice(800, 1400))
    assert statistic[1600:].max() > 3.0 * statistic[800:1400].max()


def test_the_innovations_are_those_of_filterpy():
    hour, samples = record(600, 0), record(400, 1)
    samples[300:, X] += 0.05
    samples[300:, 6] -= 0.03
    detector = DETECTORS['ekf']()
    detector.fit(hour)
    valve = Valve().record()[0]

    def flow(x, p1, p2, t1):
        return float(nominal_flow(valve, x, p1, p2, t1))

    kalman = pytest.importorskip('filterpy.kalman')
    ekf = kalman.ExtendedKalmanFilter(2, 2)
    ekf.x = np.array([[samples[0, X]], [0.0]])
    ekf.P = np.diag([detector._q, 1e-6])
    ekf.F = np.array([[detector._w[1], 1.0], [0.0, 1.0]])
    ekf.Q = np.diag([detector._q, detector.bias_noise**2])
    ekf.R = np.diag(detector._r)
    nis = np.zeros(len(samples))
    drive = detector._w[0] + detector._w[2] * samples[1:, CV] + detector._w[3] * samples[:-1, CV]
    for i in range(1, len(samples)):
        row = samples[i]
        x = detector._w[1] * ekf.x[0, 0] + ekf.x[1, 0] + drive[i - 1]
        bias = ekf.x[1, 0]
        ekf.x = np.array([[x], [bias]])
        ekf.P = ekf.F @ ekf.P @ ekf.F.T + ekf.Q
        inputs = float(row[P1]), float(row[P2]), float(row[T1])
        f = flow(x, *inputs)
        slope = (flow(x + 0.01, *inputs) - flow(x - 0.01, *inputs)) / 0.02
        jacobian = np.array([[1.0, 0.0], [slope, 0.0]])
        expected = np.array([[x], [f + detector._offset]])
        ekf.update(
            np.array([[row[X]], [row[F]]]),
            lambda _, j=jacobian: j,
            lambda _, h=expected: h,
        )
        nis[i] = float((ekf.y.T @ ekf.SI @ ekf.y)[0, 0])
    q = np.array([detector._q, detector.bias_noise**2])
    ours = _innovations(detector._record, samples, detector._w, q, detector._r, detector._offset)
    assert np.allclose(ours, nis, rtol=1e-6, atol=1e-9)
    assert nis[300:].max() > 5.0 * nis[50:300].max()
