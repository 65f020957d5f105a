# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Wrong plug force, faulty sensors, loss of supply, and what the signature costs."""

import time
from collections import Counter
from collections.abc import Callable

import numpy as np
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.state import CAUSES
from damadics_plant import Fault
from tqdm import tqdm

from damadics_evaluate.campaigns.signature.valves import (
    FRICTION,
    RATE,
    SETTINGS,
    Columns,
    family,
    plant_run,
    quantiles,
)
from damadics_evaluate.plain import Told


def plug(runs: int) -> Told:
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
    rows: list[Told] = []
    for name, faults in cases.items():
        found: dict[str, Counter[str]] = {key: Counter() for key in errors}
        kappa = dict.fromkeys(errors, 0.0)
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
                kappa[key] = max(kappa[key], round(float(s.kappa), 2))
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
                'largest kappa': kappa[key],
            }
            for key, c in found.items()
        ]
    return {'rows': rows}


def sensors(runs: int) -> Told:
    """Sensor faults in the measurement only: name and size from stage 2."""

    def change(name: str, gain: float = 0.0, offset: float = 0.0) -> Callable[[Columns], None]:
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
        named, firm, values = 0, 0, []
        seen: Counter[str] = Counter()
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


def supply(runs: int) -> Told:
    """Loss of supply pressure (f16) from 300 s on, and leaks (f9), told from the filling rate."""
    rows = []
    for name, fault in (
        ('600 to 400 kPa', Fault('f16', 1 / 3, 300.0)),
        ('600 to 500 kPa', Fault('f16', 1 / 6, 300.0)),
        ('leak f9 = 1', Fault('f9', 1.0, 300.0)),
    ):
        delays, values = [], []
        seen: Counter[str] = Counter()
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


def cost(_: int) -> Told:
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
