# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The studies, one function each."""

from functools import partial

import numpy as np
from damadics_fd.core.modes import PHASE_MONITOR
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_plant import Fault, Scenario, Simulator, simulate

from damadics_evaluate.campaigns.monitor.runs import (
    APPROXIMATOR,
    FRICTION,
    RATE,
    SPRING,
    Case,
    hour,
    irregular,
    many,
    one,
    one_exact,
    paper_run,
    random_scenario,
)
from damadics_evaluate.campaigns.monitor.sums import approximator, delays, quiet, seconds, told
from damadics_evaluate.plain import Told


def anchors(runs: int, workers: int) -> Told:
    """Noise-free runs with the control value of the paper, other strengths and variants."""
    out: Told = {}
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
    variants: dict[str, dict[str, str | float]] = {
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


def seeds(runs: int, workers: int) -> Told:
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


def exact(runs: int, workers: int) -> Told:
    """Use the condition of the specification's own figures: noise on x1, force of the plant."""
    paper = partial(paper_run, model='dablib', force_exact=True)
    out: Told = {}
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


def further(runs: int, workers: int) -> Told:
    """Repeat friction and spring with five times as many other seeds."""
    few = range(runs, 6 * runs)
    return {
        'friction ramp +1': delays(
            many(partial(one, fault=FRICTION, development=20.0), few, workers)
        ),
        'spring +1': delays(many(partial(one, fault=SPRING), few, workers)),
    }


def dablib(runs: int, workers: int) -> Told:
    """Use the same constants on the DABLib plant, control value of the paper and random."""
    job = partial(one, model='dablib')
    out: Told = {'random, nominal': quiet(many(job, range(runs), workers))}
    paper = partial(paper_run, model='dablib')
    out['paper, nominal'] = quiet(many(paper, range(runs), workers))
    out['paper, f4'] = delays(
        many(partial(paper, fault=FRICTION, development=20.0), range(runs), workers)
    )
    out['paper, f11'] = delays(many(partial(paper, fault=SPRING), range(runs), workers))
    return out


def fault_free(runs: int, workers: int) -> Told:
    """Many fault-free runs; seeds other than those of the other studies."""
    many_runs = range(1000, 1000 + (200 if runs >= 30 else runs))
    out: Told = {'approximator': quiet(many(one, many_runs, workers))}
    both = partial(one, settings=Settings.for_mode('monitor'))
    out['with the own alarm of the signature'] = quiet(many(both, many_runs, workers))
    return out


def day(runs: int, workers: int) -> Told:
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


def masking(runs: int, workers: int) -> Told:
    """Incipient faults of an hour, after arming and during learning."""
    few = range(max(1, runs // 6))
    out: Told = {}
    for start in (70.0, 30.0, 10.0):
        for fault in (FRICTION, SPRING):
            rows = many(partial(hour, fault=fault, start=start), few, workers)
            out[f'{fault} over 1 h from {start:g} s'] = [told(row) for row in rows]
    quick: dict[str, Case] = {
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


def rates(runs: int, workers: int) -> Told:
    """Other sample rates, jitter of half a period, one sample in ten dropped."""
    out: Told = {}
    some = range(max(2, runs // 3))
    for rate in (50.0, 100.0, 200.0, 500.0, 1000.0):
        for name, case in (
            ('nominal', Case()),
            ('friction', Case(fault=FRICTION, development=20.0)),
            ('spring', Case(fault=SPRING)),
        ):
            rows = many(partial(irregular, rate=rate, **case), some, workers)
            out[f'{rate:g} Hz {name}'] = quiet(rows) if name == 'nominal' else delays(rows)
    return out


def slow(runs: int, workers: int) -> Told:
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
        sum(np.sum(approximator(result).state[name] ** 2) for name in ('w1', 'w2', 'eps1', 'b1'))
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
