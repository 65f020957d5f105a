# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Fault-free runs: other patterns of the control value, a day."""

import numpy as np
from damadics_fd.core.monitor import run
from damadics_plant import LuGreActuator, Scenario
from damadics_plant.scenarios.sources import RandomSteps, Sine, Steps
from tqdm import tqdm

from damadics_evaluate.campaigns.signature.valves import RATE, SETTINGS, disturb, plant_run
from damadics_evaluate.plain import Told


def healthy(runs: int) -> Told:
    """Fault-free runs: alarms of either source, largest evidence, lowest filling rate."""
    alarms, own, worst, kappa, fill = 0, 0, [], [], []
    for k in tqdm(range(runs), desc='healthy'):
        model = 'dablib' if k % 4 == 3 else 'lugre'
        result = run(
            plant_run(6000 + k, 400.0, model, cv='paper' if k % 5 == 4 else 'random'), SETTINGS
        )
        s = result.detector.signature.state[0]
        alarms += bool(result.detections)
        own += int(s.own)
        worst.append(float(s.d_max.max()))
        kappa.append(float(s.kappa))
        fill.append(float(s.air_rate[0]))
    return {
        'runs': runs,
        'seconds each': 400,
        'runs with an alarm': alarms,
        'own alarms': own,
        'largest D, p50 p99 max': np.round(np.quantile(worst, [0.5, 0.99, 1.0]), 1).tolist(),
        'largest kappa': max(kappa),
        'lowest filling rate': round(float(np.nanmin(fill)), 3),
    }


def later_pattern(kind: str, seed: int, start: float, end: float) -> Steps:
    """Return random steps until `start`, then another pattern of the CV."""
    rng = np.random.default_rng(seed)
    times, values = [0.0], [0.5]

    def hold(seconds: float, value: float) -> None:
        times.append(times[-1] + seconds)
        values.append(float(np.clip(value, 0.0, 1.0)))

    while times[-1] < start:
        hold(rng.uniform(5, 15), rng.uniform())
    while times[-1] < end:
        if kind == 'small steps':
            hold(rng.uniform(4, 8), np.clip(values[-1] + rng.uniform(-0.12, 0.12), 0.1, 0.9))
        elif kind == 'slow ramps':
            for value in np.linspace(values[-1], rng.uniform(0.05, 0.95), 40)[1:]:
                hold(0.5, value)
        elif kind == 'full strokes':
            hold(12.0, float(values[-1] < 0.5))
        else:
            hold(rng.uniform(5, 15), rng.uniform(0, 0.4) + 0.6 * (kind == 'upper 40 %'))
    return Steps(times, values)


def patterns(runs: int) -> Told:
    """Watch fault-free valves under another pattern of the CV than they were learned under."""
    rows = []
    for kind in ('small steps', 'slow ramps', 'full strokes', 'lower 40 %', 'upper 40 %'):
        alarms, worst = 0, []
        for k in tqdm(range(runs), desc=kind):
            result = run(
                plant_run(
                    20000 + k,
                    700.0,
                    'dablib' if k % 4 == 3 else 'lugre',
                    cv=later_pattern(kind, 20000 + k, 200.0, 700.0),
                ),
                SETTINGS,
            )
            alarms += bool(result.detections)
            worst.append(float(result.detector.signature.state[0].d_max.max()))
        rows.append(
            {
                'CV from 200 s on': kind,
                'runs with an alarm': f'{alarms}/{runs}',
                'largest D, p90 max': np.round(np.quantile(worst, [0.9, 1]), 1).tolist(),
            }
        )
    return {'rows': rows}


def day(hours: int) -> Told:
    """One valve for a day without a fault, simulated and judged hour by hour."""
    from damadics_fd.core.approximator.estimator import Estimator
    from damadics_fd.core.decision.detector import Detector
    from damadics_plant.simulator import Simulator

    scenario = Scenario(
        'day',
        3600.0 * hours,
        cv=RandomSteps(0.0, 1.0, 5.0, 60.0, seed=77),
        p1=Sine(3.5e6, 175e3, 0.1),
        p2=Sine(2.6e6, 26e3, 1 / np.pi),
    )
    plant = Simulator(
        scenario, RATE, LuGreActuator(stiffness=60892 * 1.03, coulomb=28.0), noise='cv', seed=77
    )
    rng = np.random.default_rng(78)
    estimator, detector = Estimator(SETTINGS), Detector(SETTINGS)
    alarms, high = 0, np.zeros(3)
    for _ in tqdm(range(hours), desc='day'):
        columns = plant.advance(int(3600 * RATE))
        disturb(columns, rng)
        result = run(columns, SETTINGS, estimator, detector)
        alarms += len(result.detections)
        high = np.maximum(high, detector.signature.state[0].d_max[:3])
    s = detector.signature.state[0]
    return {
        'hours': hours,
        'alarms': alarms,
        'largest D (6, 30, 300)': np.round(high, 1).tolist(),
        'change now': np.round(s.now, 4).tolist(),
        'std': np.round(s.now_std, 4).tolist(),
        'filling and venting rate': np.round(s.air_rate, 3).tolist(),
    }
