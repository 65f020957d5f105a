# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Friction against the elastic family at several times after the alarm."""

from collections import Counter
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
    causes_at,
    family,
    first_alarm,
    plant_run,
    share,
    stiffened,
)
from damadics_evaluate.plain import Told


def isolation(runs: int) -> Told:
    """Friction against the elastic family at several times after the alarm."""
    cases: list[tuple[str, str, str, Callable[[float], Build]]] = [
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
                    partial(stiffened, model, change),
                )
            )
    delays = (2, 5, 10, 20, 30, 60)
    total: dict[int, Counter[str]] = {n: Counter() for n in delays}
    rows, wrong, sizes = [], [], {}
    for model, truth, name, make in tqdm(cases, desc='isolation'):
        counts: dict[int, Counter[str]] = {n: Counter() for n in delays}
        confusion: Counter[str] = Counter()
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
