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
from pathlib import Path

from damadics_evaluate.campaigns.monitor.studies import STUDIES


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
