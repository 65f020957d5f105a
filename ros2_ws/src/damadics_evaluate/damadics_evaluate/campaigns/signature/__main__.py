# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Measure what the valve signature shows: isolation, small, strong and slow changes, false alarms.

Slow (an hour for `all` on one core), not part of `make test`. Each part prints a table and adds
its figures to a JSON file:

    python -m damadics_evaluate.campaigns.signature isolation --runs 24 --out campaign.json

Plants: LuGre and DABLib with random stiffness (+-4 %), dry and viscous friction (+-20 %), CV in
random steps or as in the paper, P1 and P2 pulsating. The force comes from measured signals:
noise of the benchmark on X, 80 Pa on the chamber pressure; with `--noise all` also the
benchmark's noise on P1 and P2, which triples the noise of the force.
"""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

from damadics_evaluate.campaigns.signature.errors import cost, plug, sensors, supply
from damadics_evaluate.campaigns.signature.names import isolation
from damadics_evaluate.campaigns.signature.quiet import day, healthy, patterns
from damadics_evaluate.campaigns.signature.sizes import drift, small, strong
from damadics_evaluate.campaigns.signature.valves import NOISE
from damadics_evaluate.plain import Told

PARTS: dict[str, tuple[Callable[[int], Told], int]] = {
    'isolation': (isolation, 34),
    'small': (small, 30),
    'strong': (strong, 32),
    'drift': (drift, 10),
    'healthy': (healthy, 200),
    'patterns': (patterns, 30),
    'day': (day, 24),
    'plug': (plug, 25),
    'sensors': (sensors, 8),
    'supply': (supply, 10),
    'cost': (cost, 1),
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('parts', nargs='+', choices=[*PARTS, 'all'])
    parser.add_argument('--runs', type=int, help='runs per case (hours for "day")')
    parser.add_argument(
        '--noise',
        choices=['force', 'all'],
        default='force',
        help='force: on X and Ps; all: on P1 and P2 as well',
    )
    parser.add_argument('--out', type=Path, default=Path('signature_campaign.json'))
    options = parser.parse_args()
    if options.noise == 'all':
        NOISE.update(('p1', 'p2'))
    found = json.loads(options.out.read_text()) if options.out.exists() else {}
    for part in PARTS if 'all' in options.parts else options.parts:
        function, runs = PARTS[part]
        start = time.perf_counter()
        result = function(options.runs or runs)
        result['minutes'] = round((time.perf_counter() - start) / 60, 1)
        found[f'{part}, noise {options.noise}'] = result
        options.out.write_text(json.dumps(found, indent=1))
        rows = result.get('rows', [])
        for row in rows if isinstance(rows, list) else ():
            print(row)
        print({k: v for k, v in result.items() if k != 'rows'})


if __name__ == '__main__':
    main()
