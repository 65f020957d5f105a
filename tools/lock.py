#!/usr/bin/env python3
# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Pin all that is installed, what the requirements need in turn included, with hashes.

Writes `requirements/constraints.txt` for every supported Python; `make build` installs nothing
else than what it lists. Run it with `make lock` after a change of the requirements.
"""

import subprocess
import sys

from setup_env import CONSTRAINTS, PYTHONS, REQUIREMENTS, UV

HEADER = """# Every package with its hashes, for Python {low} to {high}. Made by: make lock
"""


def main() -> int:
    """
    Write the file.

    :return: 0, or 1 where the requirements contradict each other; the cause is on stderr.
    """
    low, high = ('.'.join(map(str, version)) for version in PYTHONS)
    command = [
        *(sys.executable, '-m', 'uv', 'pip', 'compile', '--quiet', '--universal'),
        *('--python-version', low, '--generate-hashes', '--no-header', '--no-annotate'),
        '-',
    ]
    files = sorted(path for path in REQUIREMENTS.glob('*.txt') if path != CONSTRAINTS)
    wanted = '\n'.join([UV, *(path.read_text() for path in files)])
    done = subprocess.run(command, input=wanted, text=True, stdout=subprocess.PIPE, check=False)
    if done.returncode:
        return 1
    CONSTRAINTS.write_text(HEADER.format(low=low, high=high) + done.stdout)
    print(f'{CONSTRAINTS}: {done.stdout.count("==")} packages')
    return 0


if __name__ == '__main__':
    sys.exit(main())
