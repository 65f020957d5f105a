# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Make the golden recordings in this folder and note what the detector says to them.

    python bags/make_golden.py            # bags and golden.json
    python bags/make_golden.py --check    # only compare with golden.json

The signals have the resolution of a good transmitter (24 bits of the range), which is what makes
the bags small; the decisions are those of the full double precision.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from damadics_fd.bag import BagWriter, read_columns
from damadics_fd.bag.rosbag2 import qos
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_plant.scenarios.library import load_scenario
from damadics_plant.simulator import Simulator

HERE = Path(__file__).parent
EXPECTED = HERE / 'golden.json'
FULL_SCALE = {'cv': 1.0, 'x1': 1.0, 'p1': 4e6, 'p2': 4e6, 't1': 200.0, 'flow': 16.0, 'ps': 1e6}
BITS = 24
BAGS = {  # name: scenario, plant, rate [Hz], duration [s], mode
    'dablib_nominal': ('paper_nominal', 'dablib', 400.0, 82.0, 'paper'),
    'dablib_friction': ('paper_friction', 'dablib', 400.0, 82.0, 'paper'),
    'dablib_spring': ('paper_spring', 'dablib', 400.0, 72.0, 'paper'),
    'lugre_nominal': ('random_nominal', 'lugre', 200.0, 75.0, 'monitor'),
    'lugre_friction': ('random_friction', 'lugre', 200.0, 75.0, 'monitor'),
    'lugre_spring': ('random_spring', 'lugre', 200.0, 75.0, 'monitor'),
}


def simulated(name: str) -> dict[str, np.ndarray]:
    """Return the columns of a scenario, rounded to what a transmitter resolves."""
    scenario, model, rate, duration, _ = BAGS[name]
    simulator = Simulator(load_scenario(scenario), rate, model, duration=duration, seed=1)
    blocks = []
    while not simulator.finished:
        blocks.append(simulator.advance(1 << 14))
    columns = {key: np.concatenate([block[key] for block in blocks]) for key in blocks[0]}
    for signal, span in FULL_SCALE.items():
        step = 2.0 ** (np.ceil(np.log2(span)) - BITS)
        columns[signal] = np.round(columns[signal] / step) * step
    return columns


def write(name: str, columns: dict[str, np.ndarray]) -> Path:
    """Write one bag, as small as it gets."""
    path = HERE / f'{name}.mcap'
    path.unlink(missing_ok=True)
    with BagWriter(path, level=19, chunk_size=1 << 22) as bag:
        bag.add_topic('/measurement', 'damadics_msgs/msg/Measurement', [qos(depth=1000)])
        bag.add_topic('/fault_state', 'damadics_msgs/msg/FaultState', [qos(depth=1000)])
        bag.write_columns(
            columns['stamp'],
            {
                '/measurement': {signal: columns[signal] for signal in FULL_SCALE},
                '/fault_state': {signal: columns[signal] for signal in ('strength', 'fault')},
            },
            'LC74_20',
        )
    return path


def judged(name: str) -> dict[str, object]:
    """Replay one bag; return what golden.json keeps of it."""
    mode = BAGS[name][-1]
    columns = read_columns(HERE / f'{name}.mcap')
    result = run(columns, Settings.for_mode(mode))
    return {
        'mode': mode,
        'samples': len(columns['stamp']),
        'detections_ns': [event.stamp for event in result.detections],
    }


def main() -> int:
    """Make or check the bags."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--check', action='store_true', help='only compare with golden.json')
    options = parser.parse_args()
    if not options.check:
        for name in BAGS:
            path = write(name, simulated(name))
            print(f'{path.name}: {path.stat().st_size / 1e3:.0f} kB')
    found = {name: judged(name) for name in BAGS}
    if options.check:
        wrong = [name for name in BAGS if found[name] != json.loads(EXPECTED.read_text())[name]]
        print('differ: ' + ', '.join(wrong) if wrong else 'all as expected')
        return int(bool(wrong))
    EXPECTED.write_text(json.dumps(found, indent=1) + '\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())
