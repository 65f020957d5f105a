# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small steps, strong changes, slow drifts: what is found, named and how well sized."""

from collections.abc import Callable
from functools import partial

import numpy as np
from damadics_fd.core.monitor import run
from damadics_fd.core.signature.state import CAUSES
from damadics_plant import Fault
from tqdm import tqdm

from damadics_evaluate.campaigns.signature.valves import (
    RATE,
    SETTINGS,
    Build,
    family,
    first_alarm,
    plant_run,
    quantiles,
    stiffened,
)
from damadics_evaluate.plain import Told


def unchanged(fault: Fault) -> Build:
    return (fault,), {}


def small(runs: int) -> Told:
    """Small steps, mostly for the own alarm."""
    cases: list[tuple[str, str, str, float, Callable[[], Build]]] = []
    for change in (-1.0, -0.5, -0.3, 0.3, 0.5, 1.0, 3.0):
        fault = Fault('f4', change if change < 0 else change / 20.0, 150.0)
        cases.append(
            (
                'lugre',
                f'friction {change:+g}',
                'friction_down' if change < 0 else 'friction_up',
                change,
                partial(unchanged, fault),
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
                    partial(stiffened, model, change, 150.0),
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


def strong(runs: int) -> Told:
    """Size of strong changes after short and long fault-free operation, VERIFY of 60 s."""
    cases: list[tuple[str, float, Callable[[float], Build]]] = [
        ('friction ramp to +20', 20.0, lambda t: ((Fault('f4', 1.0, t, 20.0),), {})),
        ('friction ramp to +5', 5.0, lambda t: ((Fault('f4', 0.25, t, 20.0),), {})),
        ('friction step +3', 3.0, lambda t: ((Fault('f4', 0.15, t),), {})),
    ]
    cases += [
        (f'spring {change:+.0%}', change, partial(stiffened, 'lugre', change))
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


def drift(runs: int) -> Told:
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
