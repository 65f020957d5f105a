# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Measure what monitor mode achieves: false alarms, misses, delays, masking, other sample rates.

    python -m damadics_evaluate.campaigns.monitor          everything, half an hour of CPU time
    python -m damadics_evaluate.campaigns.monitor anchors seeds    these studies only
    python -m damadics_evaluate.campaigns.monitor --runs 5         a quick look

Every run but those of `exact` takes the force from measured, noisy ps, p1, p2 and x1, as at a
plant. One JSON object per study goes to `--out`, one line of text to the screen.
"""

import argparse
import json
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from damadics_fd.core.modes import PHASE_MONITOR
from damadics_fd.core.pipeline import Result, run
from damadics_fd.core.settings import Settings
from damadics_plant import Fault, LuGreActuator, Scenario, Simulator, simulate
from damadics_plant.scenarios.sources import RandomSteps, Sine

RATE = 200.0
FRICTION, SPRING = 'f4', 'f11'
# the approximator alone: the signature's own alarm is measured by its own campaign
APPROXIMATOR = Settings.for_mode('monitor', signature=False, own_alarm=False)
EXACT = APPROXIMATOR.replace(ps_max=1e8)  # ps carries the plug force too and may be negative
PLACES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99, 1.0)  # of the plug table


def random_valve(rng: np.random.Generator) -> LuGreActuator:
    """Draw a valve around the nominal one that the settings describe."""
    coulomb = 25.0 * rng.uniform(0.8, 1.2)
    return LuGreActuator(
        stiffness=60892.0 * rng.uniform(0.96, 1.04),
        coulomb=coulomb,
        static=coulomb * rng.uniform(1.2, 1.6),
        viscous=1500.0 * rng.uniform(0.8, 1.2),
    )


def random_scenario(seed: int, duration: float, *faults: Fault) -> tuple[Scenario, LuGreActuator]:
    """Draw a random control value, pulsating pressures and a valve."""
    rng = np.random.default_rng([seed, 4])
    scenario = Scenario(
        f'random_{seed}',
        duration,
        cv=RandomSteps(seed=seed),
        p1=Sine(3.5e6, 175e3, 0.1, rng.uniform(0.0, 2 * np.pi)),
        p2=Sine(2.6e6, 26e3, 1.0 / np.pi, rng.uniform(0.0, 2 * np.pi)),
        faults=faults,
    )
    return scenario, random_valve(rng)


def random_run(
    seed: int,
    fault: str | None = None,
    strength: float = 1.0,
    start: float = 70.0,
    development: float = 0.0,
    duration: float = 120.0,
    model: str = 'lugre',
    rate: float = RATE,
    noise: bool = True,
) -> Mapping[str, np.ndarray]:
    """Simulate one random run."""
    faults = (
        ()
        if fault is None
        else (
            Fault(fault, abs(strength), start, development, direction=1 if strength > 0 else -1),
        )
    )
    scenario, valve = random_scenario(seed, duration, *faults)
    return simulate(
        scenario, rate=rate, model=valve if model == 'lugre' else model, noise=noise, seed=seed
    )


def exact_force(columns: Mapping[str, np.ndarray], seed: int) -> Mapping[str, np.ndarray]:
    """
    Put the benchmark's noise on x1 alone and let the force be the plant's own.

    Its noise is 1e-3 of the spring force over one stroke. The plug force goes into ps, with
    p1 = p2, for else the noise of x1 would enter by the place at which it is computed.
    """
    c, rng, n = EXACT, np.random.default_rng([seed, 5]), len(columns['stamp'])
    plug = (
        (columns['p1'] - columns['p2'])
        * np.pi
        * c.plug_diameter**2
        / 4.0
        / np.interp(columns['x1'], PLACES, c.plug_table)
    )
    force = 1e-3 * c.stiffness * c.stroke * rng.standard_normal(n) - plug
    hum = 2.5e-3 * np.sin(2 * np.pi * (50.0 * columns['stamp'] * 1e-9 + rng.random()))
    return {
        **columns,
        'x1': columns['x1'] + 1.41e-3 * rng.standard_normal(n) + hum,
        'p1': columns['p2'],
        'ps': columns['ps'] + force / c.area,
    }


def seconds(result: Result) -> list[float]:
    return [round(event.stamp * 1e-9, 4) for event in result.detections]


def summary(result: Result) -> dict[str, Any]:
    phase = result.estimates['phase']
    armed = np.flatnonzero(phase == PHASE_MONITOR)
    decisions = result.decisions
    counts = (decisions['threshold'] > 0) & (phase == PHASE_MONITOR)
    x = result.estimates['x1']
    counts &= (x > 0.02) & (x < 0.965)
    return {
        'alarms': seconds(result),
        'refusals': int(result.estimator.state[0].unsettled),
        'armed': float(result.estimates['stamp'][armed[0]] * 1e-9) if len(armed) else None,
        'phi': float(result.estimates['phi'][-1]),
        'ratio': float(decisions['ratio'][counts].max()) if counts.any() else 0.0,
    }


def one(seed: int, settings: Settings = APPROXIMATOR, **case: Any) -> dict[str, Any]:
    return summary(run(random_run(seed, **case), settings))


def one_exact(seed: int, **case: Any) -> dict[str, Any]:
    return summary(run(exact_force(random_run(seed, noise=False, **case), seed), EXACT))


def many(job: Callable[[int], dict[str, Any]], seeds: range, workers: int) -> list[dict[str, Any]]:
    if workers == 1:
        return [job(seed) for seed in seeds]
    with ProcessPoolExecutor(workers) as pool:
        return list(pool.map(job, seeds))


def delays(rows: list[dict[str, Any]], start: float = 70.0) -> dict[str, Any]:
    """Sum up runs with a fault: false alarms before it, misses, time of the first alarm."""
    early = sum(any(t < start for t in row['alarms']) for row in rows)
    first = [min((t for t in row['alarms'] if t >= start), default=np.inf) for row in rows]
    found = [t for t in first if np.isfinite(t)]
    low, median, high = np.percentile(found, [10, 50, 90]) if found else (np.nan,) * 3
    return {
        'runs': len(rows),
        'false_alarms': early,
        'missed': len(rows) - len(found),
        'p10': round(float(low), 3),
        'median': round(float(median), 3),
        'p90': round(float(high), 3),
        'worst': max(found, default=None),
        'not_armed_at_60s': sum(row['armed'] is None or row['armed'] > 60.1 for row in rows),
    }


def quiet(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Sum up runs without a fault."""
    ratio = [row['ratio'] for row in rows]
    return {
        'runs': len(rows),
        'false_alarms': sum(bool(row['alarms']) for row in rows),
        'refused_to_arm': sum(row['refusals'] > 0 for row in rows),
        'not_armed_at_60s': sum(row['armed'] is None or row['armed'] > 60.1 for row in rows),
        'largest_ratio_median': round(float(np.median(ratio)), 3),
        'largest_ratio_max': round(float(np.max(ratio)), 3),
    }


def anchors(runs: int, workers: int) -> dict[str, Any]:
    """Noise-free runs with the control value of the paper, other strengths and variants."""
    out: dict[str, Any] = {}
    for name in ('paper_nominal', 'paper_friction', 'paper_spring'):
        for model in ('lugre', 'dablib'):
            result = run(simulate(name, rate=RATE, model=model), APPROXIMATOR)
            at = round(69 * RATE)
            out[f'{model} {name}'] = {
                'alarms': seconds(result),
                'phi_69s': float(result.estimates['phi'][at]),
                'rho_69s': float(result.decisions['threshold'][at]),
                'alpha5': float(result.estimates['alpha5'][at]),
            }
    base = simulate('paper_nominal', rate=RATE, model='lugre').scenario
    cases = [(FRICTION, s, 20.0) for s in (0.05, 0.1, 0.25, 0.5, -1.0)]
    cases += [(SPRING, s, 0.0) for s in (0.02, 0.05, 0.2, -0.2, -1.0)]
    for fault, strength, development in cases:
        faults = (
            Fault(fault, abs(strength), 70.0, development, direction=1 if strength > 0 else -1),
        )
        scenario = Scenario(
            'case', 120.0, cv=base.cv, p1=base.p1, p2=base.p2, t1=base.t1, faults=faults
        )
        result = run(simulate(scenario, rate=RATE, model='lugre'), APPROXIMATOR)
        out[f'lugre {fault} {strength:+g}'] = seconds(result)
    variants = {
        'threshold of eq. (16)': {'threshold': 'paper'},
        'high-pass .02': {'velocity': 'high_pass'},
        'high-pass .05': {'velocity': 'high_pass', 'tau': 0.05},
        'Kalman 25': {'wn': 25.0},
        'Kalman 100': {'wn': 100.0},
        'super-twisting 20': {'velocity': 'super_twisting'},
        'coupling p = alpha5': {'coupling': 30446.0},
    }
    for name, changes in variants.items():
        settings = APPROXIMATOR.replace(**changes)
        out[f'variant {name}'] = [
            seconds(run(simulate(case, rate=RATE, model='lugre'), settings))
            for case in ('paper_nominal', 'paper_friction', 'paper_spring')
        ]
    return out


def seeds(runs: int, workers: int) -> dict[str, Any]:
    """Random control value and noise: the LuGre plant."""
    return {
        'nominal': quiet(many(one, range(runs), workers)),
        'friction ramp +1': delays(
            many(partial(one, fault=FRICTION, development=20.0), range(runs), workers)
        ),
        'spring +1': delays(many(partial(one, fault=SPRING), range(runs), workers)),
        'spring -1': delays(many(partial(one, fault=SPRING, strength=-1.0), range(runs), workers)),
        'spring -0.2': delays(
            many(partial(one, fault=SPRING, strength=-0.2), range(runs), workers)
        ),
        'friction ramp +0.25': delays(
            many(
                partial(one, fault=FRICTION, strength=0.25, development=20.0), range(runs), workers
            )
        ),
    }


def exact(runs: int, workers: int) -> dict[str, Any]:
    """Use the condition of the specification's own figures: noise on x1, force of the plant."""
    paper = partial(paper_run, model='dablib', force_exact=True)
    out = {}
    for name, few in (('', range(runs)), (', further seeds', range(runs, 6 * runs))):
        out[f'nominal{name}'] = quiet(many(one_exact, few, workers))
        out[f'friction ramp +1{name}'] = delays(
            many(partial(one_exact, fault=FRICTION, development=20.0), few, workers)
        )
        out[f'spring +1{name}'] = delays(many(partial(one_exact, fault=SPRING), few, workers))
    out['DABLib, paper, nominal'] = quiet(many(paper, range(runs), workers))
    out['DABLib, paper, f4'] = delays(
        many(partial(paper, fault=FRICTION, development=20.0), range(runs), workers)
    )
    out['DABLib, paper, f11'] = delays(many(partial(paper, fault=SPRING), range(runs), workers))
    return out


def further(runs: int, workers: int) -> dict[str, Any]:
    """Repeat friction and spring with five times as many other seeds."""
    few = range(runs, 6 * runs)
    return {
        'friction ramp +1': delays(
            many(partial(one, fault=FRICTION, development=20.0), few, workers)
        ),
        'spring +1': delays(many(partial(one, fault=SPRING), few, workers)),
    }


def dablib(runs: int, workers: int) -> dict[str, Any]:
    """Use the same constants on the DABLib plant, control value of the paper and random."""
    job = partial(one, model='dablib')
    out = {'random, nominal': quiet(many(job, range(runs), workers))}
    paper = partial(paper_run, model='dablib')
    out['paper, nominal'] = quiet(many(paper, range(runs), workers))
    out['paper, f4'] = delays(
        many(partial(paper, fault=FRICTION, development=20.0), range(runs), workers)
    )
    out['paper, f11'] = delays(many(partial(paper, fault=SPRING), range(runs), workers))
    return out


def paper_run(
    seed: int,
    model: str,
    fault: str | None = None,
    development: float = 0.0,
    force_exact: bool = False,
) -> dict[str, Any]:
    base = simulate('paper_nominal', rate=RATE, duration=0.0).scenario
    faults = () if fault is None else (Fault(fault, 1.0, 70.0, development),)
    scenario = Scenario(
        'paper', 120.0, cv=base.cv, p1=base.p1, p2=base.p2, t1=base.t1, faults=faults
    )
    columns = simulate(scenario, rate=RATE, model=model, noise=not force_exact, seed=seed)
    if force_exact:
        columns = exact_force(columns, seed)
    return summary(run(columns, EXACT if force_exact else APPROXIMATOR))


def fault_free(runs: int, workers: int) -> dict[str, Any]:
    """Many fault-free runs; seeds other than those of the other studies."""
    many_runs = range(1000, 1000 + (200 if runs >= 30 else runs))
    out = {'approximator': quiet(many(one, many_runs, workers))}
    both = partial(one, settings=Settings.for_mode('monitor'))
    out['with the own alarm of the signature'] = quiet(many(both, many_runs, workers))
    return out


def day(runs: int, workers: int) -> dict[str, Any]:
    """24 h without a fault: no alarm, weights and threshold bit-identical."""
    hours = 24.0 if runs >= 30 else 0.25
    scenario, valve = random_scenario(7, hours * 3600.0)
    plant = Simulator(scenario, rate=RATE, model=valve, noise=True, seed=7)
    estimator = detector = None
    worst, alarms, learned = 0.0, [], []
    while not plant.finished:
        result = run(plant.advance(120_000), APPROXIMATOR, estimator, detector)
        estimator, detector = result.estimator, result.detector
        alarms += seconds(result)
        armed = result.estimates['phase'] == PHASE_MONITOR
        x = result.estimates['x1']
        inside = armed & (x > 0.02) & (x < 0.965)
        if inside.any():
            worst = max(worst, float(result.decisions['ratio'][inside].max()))
        if armed.any():
            learned.append(estimator.learned())
    return {
        'hours': hours,
        'alarms': alarms,
        'largest_ratio': round(worst, 3),
        'weights_bit_identical': all(row == learned[0] for row in learned),
    }


def masking(runs: int, workers: int) -> dict[str, Any]:
    """Incipient faults of an hour, after arming and during learning."""
    few = range(max(1, runs // 6))
    out: dict[str, Any] = {}
    for start in (70.0, 30.0, 10.0):
        for fault in (FRICTION, SPRING):
            rows = many(partial(hour, fault=fault, start=start), few, workers)
            out[f'{fault} over 1 h from {start:g} s'] = rows
    quick: dict[str, dict[str, Any]] = {
        'friction ramp 20 s from 30 s': {'fault': FRICTION, 'start': 30.0, 'development': 20.0},
        'friction ramp 20 s from 55 s': {'fault': FRICTION, 'start': 55.0, 'development': 20.0},
        'friction ramp 300 s from 20 s': {
            'fault': FRICTION,
            'start': 20.0,
            'development': 300.0,
            'duration': 400.0,
        },
        'friction step +20 at 58 s': {'fault': FRICTION, 'start': 58.0},
        'friction step +3 at 50 s': {'fault': FRICTION, 'strength': 0.15, 'start': 50.0},
        'spring +0.1 at 50 s': {'fault': SPRING, 'strength': 0.1, 'start': 50.0},
    }
    for name, case in quick.items():
        rows = many(partial(one, **case), range(runs), workers)
        out[name] = {
            'runs': len(rows),
            'refused': sum(row['refusals'] > 0 for row in rows),
            'alarm': sum(not row['refusals'] and bool(row['alarms']) for row in rows),
            'neither': sum(not row['refusals'] and not row['alarms'] for row in rows),
        }
    return out


def hour(seed: int, fault: str, start: float) -> dict[str, Any]:
    result = run(random_run(seed, fault, 1.0, start, 3600.0, 3600.0 + start), APPROXIMATOR)
    row = summary(result)
    flags = result.decisions['fault']
    first = np.flatnonzero(flags)
    row['alarms'] = row['alarms'][:1]
    row['strength_at_alarm'] = ((row['alarms'][0] - start) / 3600.0) if row['alarms'] else None
    row['stays_flagged'] = bool(flags[first[0] :].all()) if len(first) else False
    return row


def rates(runs: int, workers: int) -> dict[str, Any]:
    """Other sample rates, jitter of half a period, one sample in ten dropped."""
    out: dict[str, Any] = {}
    some = range(max(2, runs // 3))
    for rate in (50.0, 100.0, 200.0, 500.0, 1000.0):
        for name, case in (
            ('nominal', {}),
            ('friction', {'fault': FRICTION, 'development': 20.0}),
            ('spring', {'fault': SPRING}),
        ):
            rows = many(partial(irregular, rate=rate, **case), some, workers)
            out[f'{rate:g} Hz {name}'] = quiet(rows) if name == 'nominal' else delays(rows)
    return out


def irregular(seed: int, rate: float, **case: Any) -> dict[str, Any]:
    """Sample a fast run at jittered instants, drop every tenth sample at random."""
    fast = random_run(seed, rate=1000.0, **case)
    rng = np.random.default_rng([seed, 9])
    period = 1000.0 / rate
    n = int((len(fast['stamp']) - 1) / period)
    instants = (np.arange(n) + rng.uniform(-0.5, 0.5, n)) * period
    if rate == 1000.0:  # the run is no finer: jitter the stamps by moving the samples with them
        columns = jittered(fast, rng)
    else:
        rows = np.unique(np.clip(np.round(instants).astype(int), 0, len(fast['stamp']) - 1))
        columns = {name: column[rows] for name, column in fast.items()}
    keep = rng.random(len(columns['stamp'])) >= 0.1
    columns = {name: column[keep] for name, column in columns.items()}
    return summary(run(columns, APPROXIMATOR.replace(sample_rate=rate)))


def jittered(fast: Mapping[str, np.ndarray], rng: np.random.Generator) -> dict[str, np.ndarray]:
    t = fast['stamp'] * 1e-9
    moved = np.sort(t + rng.uniform(-0.5e-3, 0.5e-3, len(t)))[1:-1]
    columns = {
        name: np.interp(moved, t, column) for name, column in fast.items() if name != 'stamp'
    }
    return {'stamp': np.round(moved * 1e9).astype(np.int64), **columns}


def slow(runs: int, workers: int) -> dict[str, Any]:
    """1e6 samples at 1 Hz into an observer set up for 200 Hz: finite throughout."""
    n = 1_000_000 if runs >= 30 else 20_000
    rng = np.random.default_rng(1)
    x = np.clip(np.cumsum(rng.normal(0.0, 0.05, n)) % 2.0, 0.0, 2.0)
    columns = {
        'stamp': (np.arange(n) * 1_000_000_000),
        'cv': np.clip(np.abs(x - 1.0), 0, 1),
        'x1': np.abs(x - 1.0),
        'p1': 3.5e6 + 2e5 * rng.standard_normal(n),
        'p2': np.full(n, 2.6e6),
        'ps': rng.uniform(0.0, 3e5, n),
    }
    result = run(columns, APPROXIMATOR)
    good = result.estimates[result.accepted]  # the noise takes some p1 out of range
    finite = all(np.isfinite(good[name]).all() for name in ('xi1', 'xi2', 'phi', 'x2'))
    norm = np.sqrt(
        sum(np.sum(result.estimator.state[name] ** 2) for name in ('w1', 'w2', 'eps1', 'b1'))
    )
    return {
        'samples': n,
        'accepted': result.counters['accepted'],
        'finite': bool(finite),
        'weights': float(norm),
        'largest_xi2': float(np.abs(good['xi2']).max()),
    }


STUDIES = {
    function.__name__: function
    for function in (anchors, exact, seeds, further, dablib, fault_free, day, masking, rates, slow)
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        'studies', nargs='*', choices=[[], *STUDIES], default=[], help=', '.join(STUDIES)
    )
    parser.add_argument('--runs', type=int, default=30, help='seeds per case (default 30)')
    parser.add_argument('--workers', type=int, default=1, help='processes (default 1)')
    parser.add_argument('--out', type=Path, default=Path('benchmarks/results/monitor.json'))
    options = parser.parse_args()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    results = json.loads(options.out.read_text()) if options.out.exists() else {}
    for name in options.studies or STUDIES:
        begin = time.perf_counter()
        results[name] = STUDIES[name](options.runs, options.workers)
        for key, value in results[name].items():
            print(f'{name:10s} {key}: {json.dumps(value)}', flush=True)
        print(f'{name:10s} took {time.perf_counter() - begin:.0f} s', flush=True)
        options.out.write_text(json.dumps(results, indent=1) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
