# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Measure how much faster than real time the plants run on one core.

    python benchmarks/bench_plant.py [--out FILE.json]

CPU time of the process, best of several runs, inputs and columns included. The peers are the same
source uncompiled, and for the LuGre plant scipy's Radau as an accurate general-purpose solver.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from damadics_plant import simulate

CASES = [
    ('dablib', 400, 'paper_nominal', False),
    ('dablib', 400, 'paper_friction', False),
    ('dablib', 400, 'paper_nominal', True),
    ('dablib', 1, 'nominal', False),
    ('lugre', 200, 'paper_nominal', False),
    ('lugre', 200, 'paper_friction', False),
    ('lugre', 200, 'random_spring', True),
]


def speed(model, rate, scenario, noise, runs=9, duration=120.0):
    """Return plant seconds per CPU second."""
    best = np.inf
    for _ in range(runs + 1):  # the first one compiles
        begin = time.process_time()
        simulate(scenario, rate=rate, model=model, noise=noise, duration=duration)
        best = min(best, time.process_time() - begin)
    return duration / best


def uncompiled(model, rate):
    """Return the same for the source as plain Python."""
    code = (
        f'import bench_plant; print(bench_plant.speed({model!r}, {rate}, '
        '"paper_nominal", False, runs=1, duration=1.0))'
    )
    environment = os.environ | {
        'NUMBA_DISABLE_JIT': '1',
        'PYTHONPATH': os.pathsep.join([str(Path(__file__).parent), *sys.path]),
    }
    return float(
        subprocess.run(
            [sys.executable, '-c', code],
            env=environment,
            check=True,
            capture_output=True,
            text=True,
        ).stdout
    )


def radau():
    """Return the same for scipy's Radau at rtol 1e-6 on one hold of the LuGre stem."""
    from scipy.integrate import solve_ivp

    def derivatives(t, y):
        v, x, z = y
        g = 25 + 10 * np.exp(-((v / 1e-3) ** 2))
        dz = v - 1e6 * abs(v) / g * z
        u = 2000 + 200 * np.sin(2 * t)
        return [(u - 60892 * (x + 0.009525) - 1e6 * z - 1000 * dz - 1500 * v) / 2, v, dz]

    begin = time.process_time()
    solve_ivp(derivatives, (0, 2), [0, 0.0233, 0], 'Radau', rtol=1e-6, atol=1e-9)
    return 2 / (time.process_time() - begin)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--out', type=Path)
    out = parser.parse_args().out
    rows = []
    for model, rate, scenario, noise in CASES:
        factor = speed(model, rate, scenario, noise)
        rows.append(
            {
                'model': model,
                'rate_hz': rate,
                'scenario': scenario,
                'noise': noise,
                'times_real_time': round(factor),
            }
        )
        print(
            f'{model:7} {rate:4} Hz  {scenario:15} {"noise" if noise else "     "}'
            f' {factor:8.0f} x real time'
        )
    plain = {model: uncompiled(model, rate) for model, rate in (('dablib', 400), ('lugre', 200))}
    for model, factor in plain.items():
        ratio = next(r['times_real_time'] for r in rows if r['model'] == model) / factor
        print(f'{model:7} compiled is {ratio:.0f} times as fast as its source uncompiled')
    general = radau()
    ratio = next(r['times_real_time'] for r in rows if r['model'] == 'lugre') / general
    print(f'lugre   the whole plant is {ratio:.0f} times as fast as the stem alone under Radau')
    if out:
        out.write_text(
            json.dumps(
                {
                    'machine': platform.processor() or platform.machine(),
                    'cores': os.cpu_count(),
                    'python': platform.python_version(),
                    'runs': rows,
                    'uncompiled_times_real_time': plain,
                    'radau_times_real_time': general,
                },
                indent=1,
            )
        )


if __name__ == '__main__':
    main()
