# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Measure what the valve signature shows: isolation, small, strong and slow changes, false alarms.

Slow (an hour for `all` on one core), not part of `make test`. Each part prints a table and adds
its figures to a JSON file:

    python -m damadics_evaluate.campaigns.signature isolation --runs 24 --out campaign.json

Plants: LuGre and DABLib with random stiffness (+-4 %), dry and viscous friction (+-20 %), CV in
random steps or as in the paper, P1 and P2 pulsating. The force comes from measured signals:
noise of the benchmark on X, 80 Pa on the chamber pressure; with `--noise all` also the
benchmark's noise on P1 and P2, which triples the noise of the force.
"""

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.pipeline import Result, run
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.state import CAUSES
from damadics_plant import Actuator, Fault, LuGreActuator, Scenario, simulate
from damadics_plant.actuator.parameters import RANGES
from damadics_plant.scenarios.disturbance import CHAMBER_NOISE, HUM, WHITE
from damadics_plant.scenarios.sources import RandomSteps, Sine, Steps
from tqdm import tqdm

RATE = 200.0
SETTINGS = Settings.for_mode('monitor', t_learn=60.0)
FRICTION = {'friction_up', 'friction_down', 'stick_play'}
ELASTIC = {
    'elastic',
    'spring_stiffer',
    'spring_softer',
    'preload',
    'position_gain',
    'pressure_gain',
    'dp_offset',
    'position_offset',
}
Columns = dict[str, np.ndarray]
NOISE = {'x1', 'ps'}


def paper_cv(duration: float) -> Steps:
    starts, values = (0, 20, 30, 40, 50, 60, 80), (1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0)
    laps = range(int(duration // 120) + 1)
    return Steps([120.0 * k + s for k in laps for s in starts], list(values) * len(laps))


def plant_run(
    seed: int,
    duration: float,
    model: str = 'lugre',
    faults: Iterable[Fault] = (),
    cv: str | Steps = 'random',
    **constants: float,
) -> Columns:
    """Simulate one valve of a random build; see the module for its spread and noise."""
    rng = np.random.default_rng(seed)
    build: dict[str, float] = {'stiffness': 60892.0 * (1 + rng.uniform(-0.04, 0.04))}
    dry, ratio = 25.0 * (1 + rng.uniform(-0.2, 0.2)), rng.uniform(1.2, 1.6)
    viscous = 1500.0 * (1 + rng.uniform(-0.2, 0.2))
    phase = rng.uniform(0.0, 2 * np.pi, 2)
    actuator: Actuator
    if model == 'lugre':
        build.update(coulomb=dry, static=dry * ratio, viscous=viscous)
        actuator = LuGreActuator(**{**build, **constants})
    else:
        actuator = Actuator(**{**build, **constants})
    if isinstance(cv, str):
        cv = RandomSteps(seed=seed) if cv == 'random' else paper_cv(duration)
    scenario = Scenario(
        'campaign',
        duration,
        cv=cv,
        faults=tuple(faults),
        p1=Sine(3.5e6, 175e3, 0.1, phase[0]),
        p2=Sine(2.6e6, 26e3, 1 / np.pi, phase[1]),
    )
    columns = dict(simulate(scenario, RATE, actuator, noise='cv', seed=seed))
    disturb(columns, np.random.default_rng(seed + 1))
    return columns


def disturb(columns: Columns, rng: np.random.Generator) -> None:
    """Add the benchmark's noise to the signals that the force is computed from."""
    t = columns['stamp'] * 1e-9
    for name in sorted(NOISE):
        white = rng.standard_normal(len(t))
        if name == 'ps':
            columns[name] = columns[name] + CHAMBER_NOISE * white
        else:
            hum = HUM * np.sin(2 * np.pi * 50.0 * t + 0.3)
            columns[name] = columns[name] + RANGES[name] * (hum + WHITE * white)


def stiffened(
    model: str,
    change: float,
    start: float,
    development: float = 0.0,
) -> tuple[tuple[Fault, ...], dict[str, float]]:
    """Return faults and constants that change the stiffness by a share, on either plant."""
    if model == 'lugre' or change <= 0.0:
        strength = change if model == 'lugre' else -change
        return (
            Fault('f11', abs(strength), start, development, direction=1 if strength >= 0 else -1),
        ), {}
    # f11 only softens DABLib's spring: a stiffer one is softened until the change
    return (Fault('f11', change / (1 + change), 0.0, end=start),), {
        'stiffness': 60892.0 * (1 + change)
    }


def family(cause: str) -> str:
    return 'friction' if cause in FRICTION else 'elastic' if cause in ELASTIC else ''


def first_alarm(result: Result, after: float) -> float:
    """Return the time of the first alarm of either source, NaN if there is none."""
    times = [event.stamp * 1e-9 for event in result.events if event.transition == RAISED]
    return min((t for t in times if t >= after), default=np.nan)


def causes_at(result: Result, t: float) -> str:
    row = min(int(t * RATE), len(result.decisions) - 1)
    return CAUSES[result.decisions['cause'][row]]


def share(part: int, whole: int) -> float:
    return round(part / max(whole, 1), 4)


# -- parts ------------------------------------------------------------------------------------
def isolation(runs: int) -> dict[str, Any]:
    """Friction against the elastic family at several times after the alarm."""
    cases: list[tuple[str, str, str, Callable[[float], tuple[tuple[Fault, ...], dict]]]] = [
        ('lugre', 'friction', 'ramp to +20', lambda t: ((Fault('f4', 1.0, t, 20.0),), {})),
        ('lugre', 'friction', 'ramp to +5', lambda t: ((Fault('f4', 0.25, t, 20.0),), {})),
        ('lugre', 'friction', 'step +3', lambda t: ((Fault('f4', 0.15, t),), {})),
        ('dablib', 'friction', 'play f4 = 1', lambda t: ((Fault('f4', 1.0, t, 20.0),), {})),
        ('dablib', 'friction', 'play f4 = 0.3', lambda t: ((Fault('f4', 0.3, t, 20.0),), {})),
    ]
    for model in ('lugre', 'dablib'):
        for change in (1.0, -1.0, 0.3, -0.3, 0.1, -0.1):
            cases.append(
                (
                    model,
                    'elastic',
                    f'spring {change:+.0%}',
                    lambda t, m=model, c=change: stiffened(m, c, t),
                )
            )
    delays = (2, 5, 10, 20, 30, 60)
    total = {n: Counter() for n in delays}
    rows, wrong, sizes = [], [], {}
    for model, truth, name, make in tqdm(cases, desc='isolation'):
        counts = {n: Counter() for n in delays}
        confusion: Counter = Counter()
        first, values, missed, before = [], [], 0, 0
        for k in range(runs):
            cv = 'random' if k % 13 < 10 else 'paper'
            t_fault = 130.0 if cv == 'random' else 190.0
            faults, constants = make(t_fault)
            result = run(
                plant_run(1000 + k, t_fault + 105.0, model, faults, cv, **constants), SETTINGS
            )
            if first_alarm(result, 0.0) < t_fault:
                before += 1
                continue
            alarm = first_alarm(result, t_fault)
            if np.isnan(alarm):
                missed += 1
                continue
            for n in delays:
                seen = family(causes_at(result, alarm + n))
                kind = 'right' if seen == truth else 'wrong' if seen else 'undecided'
                counts[n][kind] += 1
                total[n][kind] += 1
                if kind == 'wrong':
                    wrong.append(f'{model} {name} {cv} seed {1000 + k} +{n} s')
            confusion[causes_at(result, alarm + 60)] += 1
            named = [
                i
                for i in range(int(alarm * RATE), len(result.decisions), 20)
                if family(CAUSES[result.decisions['cause'][i]]) == truth
            ]
            first.append(named[0] / RATE - alarm if named else np.inf)
            last = result.decisions[-1]
            if truth == family(CAUSES[last['cause']]) and CAUSES[last['cause']] != 'stick_play':
                values.append(float(last['strength']))
        sizes[f'{model} {name}'] = (
            round(float(np.mean(values)), 4) if values else None,
            round(float(np.std(values)), 4) if values else None,
        )
        rows.append(
            {
                'plant': model,
                'fault': name,
                'missed': missed,
                'early': before,
                **{
                    f'+{n} s': '/'.join(str(counts[n][k]) for k in ('right', 'wrong', 'undecided'))
                    for n in delays
                },
                'named after, median / p90 s': [
                    round(float(q), 1) for q in np.quantile(first, [0.5, 0.9])
                ]
                if first
                else None,
                'at +60 s': dict(confusion),
            }
        )
    return {
        'rows': rows,
        'wrong': wrong,
        'strength': sizes,
        'total': {
            f'+{n} s': {
                **total[n],
                'decided': share(total[n]['right'] + total[n]['wrong'], sum(total[n].values())),
                'wrong share': share(total[n]['wrong'], sum(total[n].values())),
            }
            for n in delays
        },
    }


def small(runs: int) -> dict[str, Any]:
    """Small steps, mostly for the own alarm."""
    cases: list[tuple[str, str, str, float, Callable]] = []
    for change in (-1.0, -0.5, -0.3, 0.3, 0.5, 1.0, 3.0):
        fault = Fault('f4', change if change < 0 else change / 20.0, 150.0)
        cases.append(
            (
                'lugre',
                f'friction {change:+g}',
                'friction_down' if change < 0 else 'friction_up',
                change,
                lambda f=fault: ((f,), {}),
            )
        )
    for model in ('lugre', 'dablib'):
        for change in (0.02, -0.02, 0.05, -0.05):
            cases.append(
                (
                    model,
                    f'spring {change:+.0%}',
                    'spring_softer' if change < 0 else 'spring_stiffer',
                    change,
                    lambda m=model, c=change: stiffened(m, c, 150.0),
                )
            )
    rows = []
    for model, name, truth, size, make in tqdm(cases, desc='small'):
        found, named, wrong, early, delays, times, values = 0, 0, 0, 0, [], [], []
        for k in range(runs):
            faults, constants = make()
            result = run(plant_run(3000 + k, 330.0, model, faults, **constants), SETTINGS)
            alarm = first_alarm(result, 150.0)
            early += first_alarm(result, 0.0) < 150.0
            found += bool(np.isfinite(alarm))
            seen = [CAUSES[c] for c in result.decisions['cause'][int(150 * RATE) :: 20]]
            wrong += any(family(c) not in ('', family(truth)) for c in seen)
            named += seen[-1] == truth
            if np.isfinite(alarm):
                delays.append(alarm - 150.0)
            times += [0.1 * seen.index(truth)] if truth in seen else []
            values += [float(result.decisions[-1]['strength'])] if seen[-1] == truth else []
        rows.append(
            {
                'plant': model,
                'change': name,
                'found': f'{found}/{runs}',
                'named': f'{named}/{runs}',
                'wrong family ever': wrong,
                'early': early,
                'delay s': quantiles(delays),
                'named after s': quantiles(times),
                'value': round(float(np.mean(values)), 4) if values else None,
                'sd': round(float(np.std(values)), 4) if values else None,
                'true': size,
            }
        )
    return {'rows': rows}


def strong(runs: int) -> dict[str, Any]:
    """Size of strong changes after short and long fault-free operation, VERIFY of 60 s."""
    cases: list[tuple[str, float, Callable[[float], tuple[tuple[Fault, ...], dict]]]] = [
        ('friction ramp to +20', 20.0, lambda t: ((Fault('f4', 1.0, t, 20.0),), {})),
        ('friction ramp to +5', 5.0, lambda t: ((Fault('f4', 0.25, t, 20.0),), {})),
        ('friction step +3', 3.0, lambda t: ((Fault('f4', 0.15, t),), {})),
    ]
    cases += [
        (f'spring {change:+.0%}', change, lambda t, c=change: stiffened('lugre', c, t))
        for change in (1.0, -1.0, 0.3, -0.3)
    ]
    rows = []
    for minutes in (0.5, 10.0, 30.0):
        for name, size, make in tqdm(cases, desc=f'strong, {minutes:g} min'):
            values, stated = [], []
            for k in range(runs):
                t_fault = 125.0 + 60.0 * minutes
                faults, constants = make(t_fault)
                result = run(
                    plant_run(10000 + k, t_fault + 180.0, 'lugre', faults, **constants), SETTINGS
                )
                last = result.decisions[-1]
                truth = 'friction' if 'friction' in name else 'elastic'
                if family(CAUSES[last['cause']]) == truth:
                    values.append(float(last['strength']))
                    stated.append(float(last['spread']))
            rows.append(
                {
                    'change': name,
                    'min since VERIFY': minutes,
                    'named': f'{len(values)}/{runs}',
                    'value': round(float(np.mean(values)), 4),
                    'sd': round(float(np.std(values)), 4),
                    'stated sd': round(float(np.mean(stated)), 4),
                    'true': size,
                }
            )
    return {'rows': rows}


def quantiles(values: list[float]) -> list[float] | None:
    return [round(float(q), 1) for q in np.quantile(values, [0.5, 0.9])] if values else None


def drift(runs: int) -> dict[str, Any]:
    """Slow changes over an hour from 300 s on: change reached when they are found."""
    cases = [
        ('friction +1/h', 'f4', 0.05, 1.0, 1),
        ('friction +0.5/h', 'f4', 0.025, 0.5, 1),
        ('friction -0.5/h', 'f4', 0.5, 0.5, -1),
        ('spring -5 %/h', 'f11', 0.05, 0.05, -1),
        ('spring +2 %/h', 'f11', 0.02, 0.02, 1),
        ('spring -2 %/h', 'f11', 0.02, 0.02, -1),
    ]
    rows = []
    for name, fault, strength, size, way in tqdm(cases, desc='drift'):
        at, named, wrong = [], 0, 0
        for k in range(runs):
            result = run(
                plant_run(
                    4000 + k,
                    2400.0,
                    'lugre',
                    (Fault(fault, strength, 300.0, 3600.0, direction=way),),
                ),
                SETTINGS,
            )
            alarm = first_alarm(result, 0.0)
            at.append((alarm - 300.0) / 3600.0 * size)
            truth = 'friction' if fault == 'f4' else 'elastic'
            seen = [family(CAUSES[c]) for c in result.decisions['cause'][::200]]
            wrong += any(c not in ('', truth) for c in seen)
            named += seen[-1] == truth
        rows.append(
            {
                'drift': name,
                'found': f'{int(np.isfinite(at).sum())}/{runs}',
                'change when found, median / max': [
                    round(float(np.nanmedian(at)), 4),
                    round(float(np.nanmax(at)), 4),
                ],
                'named': f'{named}/{runs}',
                'wrong family ever': wrong,
            }
        )
    return {'rows': rows}


def healthy(runs: int) -> dict[str, Any]:
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


def patterns(runs: int) -> dict[str, Any]:
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


def day(hours: int) -> dict[str, Any]:
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


def plug(runs: int) -> dict[str, Any]:
    """Wrong plug force table in the detector: own alarms without a fault, and what is found."""
    rng = np.random.default_rng(9)
    table = np.asarray(SETTINGS.plug_table)
    x = np.array([0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99, 1.0])

    def shape(size: float) -> Settings:
        return SETTINGS.replace(plug_table=tuple(table * (1 + size * rng.standard_normal(12))))

    def wave() -> Settings:
        phase, waves = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 2.0)
        bump = 0.01 * np.sin(2 * np.pi * waves * x + phase)
        return SETTINGS.replace(plug_table=tuple(table * (1 + bump)))

    def gain(share: float) -> Settings:
        return SETTINGS.replace(plug_diameter=0.05 * (1 + share) ** 0.5)

    errors: dict[str, Callable[[], Settings]] = {
        'none': lambda: SETTINGS,
        'gain +1 %': lambda: gain(0.01),
        'gain -1 %': lambda: gain(-0.01),
        'gain +3 %': lambda: gain(0.03),
        'shape 1 % per node': lambda: shape(0.01),
        'shape 1 % wave': wave,
        'P1, P2 taken constant': lambda: SETTINGS,
        'gain +1 %, table taken as exact': lambda: gain(0.01).replace(
            plug_gain_std=1e-6, plug_shape_std=1e-6
        ),
    }
    cases = {
        'no fault': (),
        'friction -0.5': (Fault('f4', -0.5, 230.0),),
        'friction +1': (Fault('f4', 0.05, 230.0),),
        'spring +5 %': (Fault('f11', 0.05, 230.0),),
    }
    rows = []
    for name, faults in cases.items():
        found = {key: Counter() for key in errors}
        for k in tqdm(range(runs), desc=f'plug, {name}'):
            columns = plant_run(7000 + k, 430.0, 'lugre', faults)
            for key, make in errors.items():
                data = dict(columns)
                if 'constant' in key:
                    data.update(
                        p1=np.full_like(data['p1'], 3.5e6), p2=np.full_like(data['p2'], 2.6e6)
                    )
                result = run(data, make())
                s = result.detector.signature.state[0]
                found[key]['own'] += int(s.own)
                found[key]['early'] += bool(
                    result.detections and result.detections[0].stamp < 230e9
                )
                found[key]['alarm'] += bool(result.detections)
                found[key][family(CAUSES[s.cause])] += 1
                found[key]['kappa'] = max(found[key]['kappa'], round(float(s.kappa), 2))
        rows += [
            {
                'fault': name,
                'error': key,
                'runs': runs,
                'own alarms': c['own'],
                'alarms': c['alarm'],
                'before 230 s': c['early'],
                'called friction': c['friction'],
                'called elastic': c['elastic'],
                'largest kappa': c['kappa'],
            }
            for key, c in found.items()
        ]
    return {'rows': rows}


def sensors(runs: int) -> dict[str, Any]:
    """Sensor faults in the measurement only: name and size from stage 2."""

    def change(name: str, gain: float = 0.0, offset: float = 0.0) -> Callable:
        def apply(columns: Columns) -> None:
            late = columns['stamp'] >= 150e9
            columns[name] = np.where(late, columns[name] * (1 + gain) + offset, columns[name])

        return apply

    cases = [
        (f'position gain {g:+.0%}', 'position_gain', g, change('x1', gain=g))
        for g in (0.05, -0.05, 0.02, -0.02)
    ]
    cases += [
        (f'position offset {o:+g}', 'position_offset', o, change('x1', offset=o))
        for o in (0.03, -0.03, 0.01, -0.01)
    ]
    cases += [
        (f'Ps gain {g:+.0%}', 'pressure_gain', g, change('ps', gain=g))
        for g in (0.05, -0.05, 0.02, -0.02)
    ]
    cases += [
        (f'Ps offset {o / 1e3:+g} kPa', 'preload', o * 0.029, change('ps', offset=o))
        for o in (5e3, -5e3, 2e3, -2e3)
    ]
    cases += [
        (f'P1 gain {g:+.0%}', 'dp_offset', g * 3.5e6, change('p1', gain=g)) for g in (0.03, -0.03)
    ]
    cases += [('P1 offset 50 kPa', 'dp_offset', 50e3, change('p1', offset=50e3))]
    rows = []
    for name, truth, size, apply in tqdm(cases, desc='sensors'):
        named, firm, values, seen = 0, 0, [], Counter()
        for k in range(runs):
            columns = plant_run(8000 + k, 420.0)
            apply(columns)
            result = run(columns, SETTINGS)
            last = result.decisions[-1]
            cause = CAUSES[last['cause']]
            seen[cause] += 1
            named += cause == truth
            firm += any(CAUSES[c] in FRICTION for c in np.unique(result.decisions['cause']))
            values += [float(last['strength'])] if cause == truth else []
        rows.append(
            {
                'fault': name,
                'named': f'{named}/{runs}',
                'ever friction': firm,
                'value': round(float(np.mean(values)), 4) if values else None,
                'sd': round(float(np.std(values)), 4) if values else None,
                'true': round(size, 4),
                'seen': dict(seen),
            }
        )
    return {'rows': rows}


def supply(runs: int) -> dict[str, Any]:
    """Loss of supply pressure (f16) from 300 s on, and leaks (f9), told from the filling rate."""
    rows = []
    for name, fault in (
        ('600 to 400 kPa', Fault('f16', 1 / 3, 300.0)),
        ('600 to 500 kPa', Fault('f16', 1 / 6, 300.0)),
        ('leak f9 = 1', Fault('f9', 1.0, 300.0)),
    ):
        delays, values, seen = [], [], Counter()
        for k in range(runs):
            result = run(plant_run(9000 + k, 900.0, 'lugre', (fault,)), SETTINGS)
            rowsof = np.flatnonzero(result.decisions['cause'] == CAUSES.index('supply'))
            seen[CAUSES[result.decisions['cause'][-1]]] += 1
            if len(rowsof):
                delays.append(rowsof[0] / RATE - 300.0)
                values.append(float(result.decisions['strength'][rowsof[0]]))
        rows.append(
            {
                'fault': name,
                'called supply': f'{len(delays)}/{runs}',
                'delay s': quantiles(delays),
                'seen at the end': dict(seen),
                'value Pa': round(float(np.mean(values))) if values else None,
            }
        )
    return {'rows': rows}


def cost(_: int) -> dict[str, Any]:
    """Time per sample in the compiled loop, with and without the signature."""
    columns = plant_run(1, 1200.0)
    times = {}
    for name, settings in (('with', SETTINGS), ('without', SETTINGS.replace(signature=False))):
        run(columns, settings)
        laps = []
        for _ in range(5):
            start = time.perf_counter()
            run(columns, settings)
            laps.append(time.perf_counter() - start)
        times[name] = min(laps) / len(columns['stamp'])
    extra = times['with'] - times['without']
    return {
        'us per sample with': round(times['with'] * 1e6, 3),
        'us per sample without': round(times['without'] * 1e6, 3),
        'share of a core at 200 Hz': f'{extra * RATE:.2e}',
    }


PARTS: dict[str, tuple[Callable[[int], dict[str, Any]], int]] = {
    'isolation': (isolation, 34),
    'small': (small, 30),
    'strong': (strong, 32),
    'drift': (drift, 10),
    'healthy': (healthy, 200),
    'patterns': (patterns, 30),
    'day': (day, 24),
    'plug': (plug, 25),
    'sensors': (sensors, 8),
    'supply': (supply, 10),
    'cost': (cost, 1),
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('parts', nargs='+', choices=[*PARTS, 'all'])
    parser.add_argument('--runs', type=int, help='runs per case (hours for "day")')
    parser.add_argument(
        '--noise',
        choices=['force', 'all'],
        default='force',
        help='force: on X and Ps; all: on P1 and P2 as well',
    )
    parser.add_argument('--out', type=Path, default=Path('signature_campaign.json'))
    options = parser.parse_args()
    if options.noise == 'all':
        NOISE.update(('p1', 'p2'))
    found = json.loads(options.out.read_text()) if options.out.exists() else {}
    for part in PARTS if 'all' in options.parts else options.parts:
        function, runs = PARTS[part]
        start = time.perf_counter()
        result = function(options.runs or runs)
        result['minutes'] = round((time.perf_counter() - start) / 60, 1)
        found[f'{part}, noise {options.noise}'] = result
        options.out.write_text(json.dumps(found, indent=1))
        for row in result.get('rows', []):
            print(row)
        print({k: v for k, v in result.items() if k != 'rows'})


if __name__ == '__main__':
    main()
