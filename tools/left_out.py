#!/usr/bin/env python3
# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Print which lines `make coverage` leaves out, as nothing of them is run."""

from itertools import groupby
from pathlib import Path

from coverage import Coverage


def spans(lines: list[int]) -> str:
    """
    Write lines as a reader of a report expects them.

    >>> spans([3, 7, 8, 9])
    '3, 7-9'
    """
    runs = [
        [line for _, line in run]
        for _, run in groupby(enumerate(lines), lambda pair: pair[1] - pair[0])
    ]
    return ', '.join(f'{run[0]}-{run[-1]}' if len(run) > 1 else str(run[0]) for run in runs)


def main() -> None:
    """Read the data of the last run."""
    coverage = Coverage()
    coverage.load()
    print('Left out: blocks of TYPE_CHECKING, protocols, abstract methods:')
    for file in sorted(coverage.get_data().measured_files()):
        excluded = coverage.analysis2(file)[2]
        if excluded:
            print(f'{Path(file).relative_to(Path.cwd())}: {spans(excluded)}')


if __name__ == '__main__':
    main()
