# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The LuGre plant against an independent stiff integration of equations (1)-(9)."""

import numpy as np
import pytest
from damadics_plant import Fault, LuGreActuator, Scenario, Simulator, simulate
from damadics_plant.scenarios.sources import Steps
from scipy.integrate import solve_ivp

BEGIN, HOLD = 10.01, 0.035  # s; BEGIN is a tick of the positioner and a sample at 200 Hz
KM_X = [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99, 1.0]
KM_Y = [1, 0.95, 0.90, 0.85, 0.785, 0.725, 0.67, 0.61, 0.555, 0.5, 0.45, 0.40]
CV = Steps((0.0, 10.5, 12.0, 13.0), (0.7, 0.5, 0.6, 0.3))


def derivatives(t, y, cv, opening, d1, d2):
    """Evaluate the plant in the paper's symbols; y = y1, y2, ma, v, x, z."""
    y1, y2, ma, v, x, z = y
    p = ma * 287 * 293 / (0.0055 + 0.029 * x)
    ps = p - 101325
    drop = (600e3 if opening > 0 else 0.0) - ps
    fvc = 0.9e6 / np.interp(x / 0.0381, KM_X, KM_Y) * np.pi * 50**2 / 4e6
    u = 2 * 9.81 + 0.029 * ps - fvc
    g = 25 + 10 * np.exp(-((v / 1e-3) ** 2))
    dz = v - 1e6 * abs(v) / g * z
    friction = (1 + d1(t)) * (1e6 * z + 1000 * dz + 1500 * v)
    dv = (u - 60892 * (1 + d2(t)) * (x + 0.009525) - friction) / 2
    return [
        (cv - y1) / 0.3,
        (y1 - y2) / 0.3,
        2.5e-6 * abs(opening) * np.sign(drop) * np.sqrt(abs(drop)),
        dv,
        v,
        dz,
    ]


def before(strength, end):
    """Keep what begins at the end of an interval out of it."""
    return lambda t: strength(min(t, end - 1e-9))


def radau(state, seconds, d1, d2):
    """Integrate from a state of the simulator; return X at 200 Hz."""
    y = [float(state[name]) for name in ('y1', 'y2', 'ma', 'v', 'x', 'z')]
    ticks = BEGIN + HOLD * np.arange(round(seconds / HOLD) + 1)
    switches = sorted({11.0, *(t for t in CV.times if t > BEGIN)})  # faults begin at 11 s
    samples = [y[4] / 0.0381]
    for begin, end in zip(ticks, ticks[1:], strict=False):
        cvi = np.clip(100 * (y[1] - y[4] / 0.0381), -1, 1)
        opening = np.interp(
            cvi, [-1, -0.94, -0.54, 0.46, 0.86, 1], [-0.55, -0.55, -0.02, 0.02, 1, 1]
        )
        cuts = [begin, *(t for t in switches if begin + 1e-9 < t < end - 1e-9), end]
        for a, b in zip(cuts, cuts[1:], strict=False):
            cv = CV.at(np.array([a + 1e-6]))[0]
            grid = np.arange(round(a * 200), round(b * 200) + 1) / 200
            solution = solve_ivp(
                derivatives,
                (a, b),
                y,
                'Radau',
                t_eval=np.clip(grid, a, b),
                args=(cv, opening, *(before(d, b) for d in (d1, d2))),
                rtol=1e-9,
                atol=[1e-12, 1e-12, 1e-15, 1e-12, 1e-13, 1e-15],
            )
            assert solution.success
            y = list(solution.y[:, -1])
            samples += list(solution.y[4, 1:] / 0.0381)
    return np.array(samples)


@pytest.mark.parametrize(
    'fault',
    [
        None,
        Fault('f4', 0.3, start=10, development=2),
        Fault('f11', 0.5, start=10, development=3),
        Fault('f11', -0.5, start=11),
        Fault('f11', 0.5, start=11),
    ],
    ids=str,
)
def test_agrees_with_radau(fault):
    seconds = 3.5
    scenario = Scenario('test', BEGIN + seconds, cv=CV, faults=(fault,) if fault else ())
    simulator = Simulator(scenario, rate=200, model='lugre')
    simulator.advance(round(BEGIN * 200))
    strength = [
        fault.at if fault and fault.fault == name else lambda t: 0.0 for name in ('f4', 'f11')
    ]
    reference = radau(simulator._state[0], seconds, lambda t: 20 * strength[0](t), strength[1])
    x = simulator.advance(10_000)['x1']
    assert np.ptp(reference) > 0.01
    assert np.abs(x - reference[: len(x)]).max() < 3e-4


@pytest.mark.parametrize(('h', 'friction'), [(2.5e-3, 1), (1e-3, 21)])
def test_explicit_schemes_diverge(h, friction):
    """Guard the implicit scheme: a simpler one would not do."""
    y = np.array([0.7, 0.7, 0.0207, 0.0, 0.0266, 2e-5])
    with np.errstate(all='ignore'):
        for _ in range(400):
            y = y + h * np.array(
                derivatives(0, y, 0.7, 0.01, lambda t: friction - 1, lambda t: 0.0)
            )
    assert not np.abs(y[3]) < 1


def test_constants_can_be_spread():
    stiff = simulate('random_nominal', model=LuGreActuator(stiffness=60892 * 1.04), duration=30)
    sticky = simulate('random_nominal', model=LuGreActuator(coulomb=250, static=350), duration=30)
    nominal = simulate('random_nominal', model='lugre', duration=30)
    assert np.abs(stiff.ps - nominal.ps).max() > 1e3
    assert np.abs(sticky.x1 - nominal.x1).max() > 0.01
