# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Measure what one sample costs in estimator and detector, in the compiled loop and from Python.

    python benchmarks/bench_core.py [--samples N] [--out FILE.json]

Compared in the same run with the observer of one sample in plain Python floats, without check,
adaptation or decision: the least that a node without compiled code would do.
"""

import argparse
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.monitor import run
from damadics_fd.core.quality import Refused
from damadics_fd.core.sample import COLUMNS
from damadics_fd.core.settings import Settings
from damadics_plant import simulate


def recording(n: int, rate: float) -> dict[str, np.ndarray]:
    """Return a healthy valve that moves all the time, with noisy sensors."""
    run = simulate('random_nominal', rate, 'lugre', noise=True, duration=n / rate)
    return {name: run[name][:n] for name in COLUMNS}


def best(function: Callable[[], Any], repeat: int) -> float:
    """Return the least CPU time of some runs [s]."""
    times = []
    for _ in range(repeat):
        begin = time.process_time()
        function()
        times.append(time.process_time() - begin)
    return min(times)


def plain_python(columns: dict[str, np.ndarray]) -> None:
    """Run filter, observer and threshold as one would write them down in plain floats."""
    dt, k1, k2, a1, a5, delta, wn, P = 0.005, 100.0, 400.0, 750.0, 30446.0, 0.03, 50.0, 350.0
    zd = math.exp(-0.707 * wn * dt)
    alpha, beta = 1 - zd * zd, 1 + zd * zd - 2 * zd * math.cos(0.7072 * wn * dt)
    lag = (alpha / beta - 0.5) * dt
    y = u = columns['x1'][0].item() + 0.25
    vy = vu = xh1 = xh2 = 0.0
    for x, ps in zip(columns['x1'].tolist(), columns['ps'].tolist(), strict=True):
        e = x + 0.25 - y - dt * vy
        y, vy = y + dt * vy + alpha * e, vy + beta / dt * e
        e = 0.0085 + ps * 1.25e-5 - 0.76 / (1.0 - 0.5 * x) - u - dt * vu
        u, vu = u + dt * vu + alpha * e, vu + beta / dt * e
        x1, x2, uf = y - lag * vy, vy, u - lag * vu
        den = 1.0 + dt * (a1 + k2)
        R = x2 - xh2 + dt * (a1 * x2 + a5 * x1 - a5 * uf)
        xi2 = R / (den + dt * P / delta)
        if abs(xi2) > delta:
            xi2 = (R - dt * P) / den if R > 0.0 else (R + dt * P) / den
        xi1 = (x1 - xh1 - dt * x2) / (1.0 + dt * k1)
        xh1, xh2 = x1 - xi1, x2 - xi2
        _exceed = abs(xi2) >= max(1.5 * P / (k2 + a1), 0.2)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--samples', type=int, default=1_000_000)
    parser.add_argument('--out', type=Path)
    options = parser.parse_args()
    few = 20_000
    cases = {
        'paper': Settings.for_mode('paper'),
        'monitor, approximator': Settings.for_mode('monitor', signature=False, own_alarm=False),
        'monitor with signature': Settings.for_mode('monitor'),
    }
    results: dict[str, dict[str, float]] = {}
    for name, settings in cases.items():
        columns = recording(options.samples, settings.sample_rate)
        pieces = [
            {key: column[i : i + 8192] for key, column in columns.items()}
            for i in range(0, options.samples, 8192)
        ]
        run(pieces[0], settings)

        def loop(settings: Settings = settings, pieces: list = pieces) -> None:
            estimator, detector = Estimator(settings), Detector(settings)
            for piece in pieces:
                run(piece, settings, estimator, detector)

        rows = list(zip(*(columns[key][:few].tolist() for key in COLUMNS), strict=True))

        def calls(settings: Settings = settings, rows: list = rows) -> None:
            estimator, detector = Estimator(settings), Detector(settings)
            for row in rows:
                estimate = estimator.update(*row)
                if not isinstance(estimate, Refused):
                    detector.update(estimate)

        head = {key: column[:few] for key, column in columns.items()}
        reference = best(lambda head=head: plain_python(head), 3) / few * 1e6
        in_loop, per_call = best(loop, 5) / options.samples * 1e6, best(calls, 3) / few * 1e6
        results[name] = {
            'us_per_sample_in_the_loop': in_loop,
            'us_per_call': per_call,
            'us_plain_python_observer': reference,
            'loop_vs_plain_python': reference / in_loop,
            'million_samples_per_s': 1.0 / in_loop,
        }
        print(
            f'{name:24s} loop {in_loop:.4f} us/sample ({1.0 / in_loop:.1f} M samples/s), '
            f'call {per_call:.2f} us, plain Python observer alone {reference:.2f} us: '
            f'the loop is {reference / in_loop:.0f} times faster'
        )
    if options.out:
        options.out.write_text(json.dumps(results, indent=1) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
