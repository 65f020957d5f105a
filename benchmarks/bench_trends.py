# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Ten years of trend of many valves: size of the file, time to open any range, report of a year.

    python benchmarks/bench_trends.py --valves 100
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from damadics_bringup.processes import executable
from damadics_dashboard.store.history import History
from damadics_fd.store.intervals import DAY, KEPT, LEVELS, ROW, Intervals

RANGES = (1, 7, 30, 90, 365, 730, 1825, 3650)  # days
TEN_YEARS = 3650 * DAY
NAME = 'v{:03d}'


def fill(store: Intervals, valves: int, now: int) -> None:
    """Fill every interval that is kept, of every valve."""
    chance = np.random.default_rng(0)
    for n in range(valves):
        store.add(NAME.format(n), now - 900, {'friction': 0.1})
    db = store._db
    with db:
        for level, kept in zip(LEVELS, KEPT, strict=True):
            begin = int(now - min(kept, TEN_YEARS)) // level * level
            rows = [
                (1, t, 1, 1, chance.normal(size=ROW.shape).astype(np.float32).tobytes())
                for t in range(begin, now - level, level)
            ]
            table = f'point_{level}'
            db.executemany(f'INSERT OR REPLACE INTO {table} VALUES (?,?,?,?,?)', rows)
            for n in range(2, valves + 1):
                db.execute(
                    f'INSERT OR REPLACE INTO {table} '
                    f'SELECT {n}, start, count, reference, data FROM {table} WHERE valve = 1'
                )


def opened(store: Intervals, valves: int, now: int) -> tuple[float, float]:
    """Return the longest time to read a range, wall and CPU [s]."""
    wall, cpu = 0.0, 0.0
    for valve in (0, valves // 2, valves - 1):
        for quantity in ('friction', 'supply'):
            for days in RANGES:
                for end in (now, now - days * DAY):
                    at, used = time.perf_counter(), time.process_time()
                    store.series(NAME.format(valve), quantity, end - days * DAY, end)
                    wall = max(wall, time.perf_counter() - at)
                    cpu = max(cpu, time.process_time() - used)
    return wall, cpu


def report(folder: Path, valve: str, now: int) -> tuple[float, float, float]:
    """Return wall and CPU time [s] and memory [MB] of a report on a year, with its start."""
    day = [datetime.fromtimestamp(t, UTC).strftime('%Y-%m-%d') for t in (now - 365 * DAY, now)]
    words = [executable('damadics_dashboard', 'report'), valve, '--from', day[0], '--to', day[1]]
    words += ['--state', str(folder), '--out', str(folder)]  # HTML, PDF and CSV
    at = time.perf_counter()
    child = subprocess.Popen(words, stdout=sys.stderr)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise SystemExit(f'report ended with {child.returncode}')
    wall = time.perf_counter() - at
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main() -> None:
    """Fill, read, report, forget."""
    p = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    p.add_argument('--valves', type=int, default=100)
    options = p.parse_args()
    now = int(time.time())
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / 'trends.sqlite'
        store = Intervals(path)
        fill(store, options.valves, now)
        store.close()
        print(f'{options.valves} valves, ten years: {path.stat().st_size / 1e6:.0f} MB')
        store = Intervals(path)
        wall, cpu = opened(store, options.valves, now)
        print(f'any range of {RANGES} days: within {1e3 * wall:.0f} ms, CPU {1e3 * cpu:.0f} ms')
        later = now + 10 * DAY
        store.forget(later)
        for level, kept in zip(LEVELS, KEPT, strict=True):
            (oldest,) = store._db.execute(f'SELECT min(start) FROM point_{level}').fetchone()
            print(f'intervals of {level} s: {(later - oldest) / DAY:.1f} days, {kept / DAY} kept')
        store.close()
        History(Path(name) / 'history.sqlite').close()
        wall, cpu, size = report(Path(name), NAME.format(options.valves // 2), now)
        print(f'report of a valve-year: {wall:.1f} s, CPU {cpu:.1f} s, {size:.0f} MB')


if __name__ == '__main__':
    main()
