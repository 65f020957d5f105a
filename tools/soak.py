#!/usr/bin/env python3
# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Run two valves for hours with page and recorder: memory, false alarms, samples.

    make soak                                        an hour, then five hours ten times as fast
    make soak ARGS='--minutes 10 --fast-minutes 0'

Exit code 1 where memory grows after the first half, an alarm was raised, or a sample is missing.
"""

import argparse
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import yaml
from ament_index_python.packages import get_package_prefix
from damadics_bringup.processes import free_domain, surroundings
from damadics_fd.bag.columns import read_columns
from damadics_fd.bag.errors import BagError
from damadics_msgs.msg import FaultEvent

VALVES = ('lv101', 'lv102')
RATE = 100.0  # Hz, in real time
FAST_RATE = 50.0  # Hz, where time runs faster: two cores carry no more
GROWTH = 0.03  # of a process's memory in the second half
SMALL = 8_000_000  # bytes per hour, that are not called growth
LOOK = 5.0  # s
TELL = 300.0  # s between two lines about memory
FACTOR = 10.0
CHROMIUM = '/usr/bin/chromium'


def fleet_file(folder: Path, rate: float, factor: float) -> Path:
    """Write the list of the valves."""
    valves = {
        name: {
            'settings': {'actuator': name.upper(), 'sample_rate': rate},
            'simulate': {
                'scenario': 'random_nominal',
                'model': 'lugre',
                'noise': True,
                'rate': rate,
                'seed': seed,
                'real_time_factor': factor,
            },
        }
        for seed, name in enumerate(VALVES, 1)
    }
    file = folder / 'fleet.yaml'
    file.write_text(yaml.safe_dump({'valves': valves}))
    return file


def family(process: int) -> dict[int, str]:
    """List a process's children by number, with what they run."""
    words = Path(f'/proc/{process}/task/{process}/children').read_text().split()
    names = {}
    for number in map(int, words):
        line = Path(f'/proc/{number}/cmdline').read_bytes().decode(errors='replace').split('\0')
        place = next((w.removeprefix('__ns:=') for w in line if w.startswith('__ns:=')), '')
        names[number] = f'{Path(line[1]).name}{place}'
    return names


def resident(process: int) -> int:
    """Return the memory that a process uses [B]."""
    for line in Path(f'/proc/{process}/status').read_text().splitlines():
        if line.startswith('VmRSS'):
            return int(line.split()[1]) * 1024
    return 0


def pages(stack: ExitStack, address: str) -> int:
    """Open the page in two browsers, where there is one; return how many."""
    try:
        from playwright.sync_api import sync_playwright

        playwright = stack.enter_context(sync_playwright())
        for path in ('/', f'/valve/{VALVES[0]}'):
            browser = playwright.chromium.launch(
                executable_path=CHROMIUM, args=['--no-sandbox', '--disable-gpu']
            )
            stack.callback(browser.close)
            browser.new_page().goto(address + path)
    except Exception as problem:
        print(f'no browser: {str(problem).splitlines()[0]}', file=sys.stderr)
        return 0
    return 2


def alarms(bag: Path, topic: str) -> int:
    """Count the alarms in a recording."""
    try:
        return int((read_columns(bag, topic)['transition'] == FaultEvent.RAISED).sum())
    except BagError:  # nothing was ever published there
        return 0


def soak(folder: Path, minutes: float, rate: float, factor: float) -> list[str]:
    """
    Run the fleet once.

    :param folder: for everything.
    :param minutes: of wall time.
    :param rate: of the samples [Hz of simulated time].
    :param factor: seconds of simulation per second.
    :return: what was found.
    """
    folder.mkdir(parents=True)
    with socket.create_server(('127.0.0.1', 0)) as free:
        port = free.getsockname()[1]
    run = Path(get_package_prefix('damadics_bringup'), 'lib', 'damadics_bringup', 'run')
    words = ['--simulate', '--dashboard', '--port', str(port), '--record', str(folder / 'bag')]
    environment = {
        **os.environ,
        **surroundings(free_domain()),
        'XDG_STATE_HOME': str(folder / 'state'),
    }
    found = []
    history: dict[str, list[tuple[float, int]]] = {}
    with ExitStack() as stack:
        process = subprocess.Popen(
            [
                str(run),
                str(fleet_file(folder, rate, factor)),
                *words,
                '--logs',
                str(folder / 'logs'),
            ],
            env=environment,
        )
        stack.callback(process.kill)
        time.sleep(30.0)
        opened = pages(stack, f'http://127.0.0.1:{port}')
        began = time.monotonic()
        known = family(process.pid)
        told = -TELL
        while (passed := time.monotonic() - began) < 60.0 * minutes:
            time.sleep(min(LOOK, 60.0 * minutes - passed + 0.1))
            if process.poll() is not None:
                return [f'run ended with {process.returncode}']
            now = family(process.pid)
            if set(now) != set(known):
                found.append(
                    f'processes came or went: {sorted(set(now.items()) ^ set(known.items()))}'
                )
                known = now
            for number, name in now.items():
                history.setdefault(name, []).append((passed, resident(number)))
            if passed - told >= TELL:
                told = passed
                sizes = (f'{name} {series[-1][1] / 1e6:.1f}' for name, series in history.items())
                print(f'{passed / 60.0:5.1f} min, MB:', *sizes, flush=True)
        process.send_signal(signal.SIGINT)
        process.wait(120.0)
    for name, series in history.items():
        half = [size for at, size in series if at > 30.0 * minutes]
        first, last = half[: len(half) // 4 or 1], half[-(len(half) // 4 or 1) :]
        before, after = float(np.median(first)), float(np.median(last))
        print(f'{name:<24} {before / 1e6:8.1f} MB -> {after / 1e6:8.1f} MB')
        allowed = max(GROWTH * before, SMALL * minutes / 60.0)
        if after - before > allowed:
            found.append(f'{name} grew by {(after - before) / 1e6:.1f} MB')
    for name in VALVES:
        stamp = read_columns(folder / 'bag', f'/{name}/measurement')['stamp']
        judged = read_columns(folder / 'bag', f'/{name}/residual')['stamp']
        steps = np.diff(stamp)
        lost = round(float((steps / steps.min() - 1.0).sum()))
        at_ends = (stamp < judged[0]) | (stamp > judged[-1])
        passed_over = int(np.count_nonzero(~at_ends & ~np.isin(stamp, judged)))
        late = int(np.count_nonzero(at_ends))
        raised = alarms(folder / 'bag', f'/{name}/fault_event')
        counts = f'{lost} lost, {passed_over} not judged, {late} at the ends, {raised} alarms'
        print(f'{name}: {len(stamp)} samples, {counts}')
        if lost or passed_over or late > rate * factor or raised:
            found.append(f'{name}: {counts}')
    print(f'{minutes:g} min at {factor:g} x, {rate:g} Hz, {opened} pages open')
    return found


def main() -> int:
    """
    Run the soak.

    :return: 0, or 1 where something was found.
    """
    p = argparse.ArgumentParser(prog='soak', description=__doc__.split('\n')[1])
    p.add_argument('--minutes', type=float, default=60.0, help='in real time (60)')
    p.add_argument('--fast-minutes', type=float, default=30.0, help='faster (30)')
    p.add_argument(
        '--factor',
        type=float,
        default=FACTOR,
        help=f'how much faster; {FACTOR:g} needs two quiet cores ({FACTOR:g})',
    )
    options = p.parse_args()
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for minutes, rate, factor in (
            (options.minutes, RATE, 1.0),
            (options.fast_minutes, FAST_RATE, options.factor),
        ):
            if minutes > 0.0:
                found += soak(Path(folder, f'x{factor:g}'), minutes, rate, factor)
    print(json.dumps(found, indent=1))
    return int(bool(found))


if __name__ == '__main__':
    sys.exit(main())
