# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `commission` has found out about a valve, as the file of the valve tells its nodes."""

from collections.abc import Iterable
from pathlib import Path

import yaml

from damadics_fd.core.record import Plain, Saved
from damadics_fd.core.settings.document import COMMISSION, section
from damadics_fd.core.settings.identified import VERDICTS
from damadics_fd.core.text import SENTENCE, plain

NOT_YET = 'no'
LARGEST = 10.0  # share; a change that is found from there on only is not told
FOUND = {'Friction': 'friction_in_an_hour', 'Stiffness': 'spring_in_an_hour'}


def commissioned(files: Iterable[Path]) -> dict[str, str]:
    """
    Return the verdict of `commission` for the diagnostics.

    :param files: parameter files of the node; the last one with a verdict counts.
    :return: verdict (`no` where there is none), the smallest changes that are found within an
        hour, and why the verdict is not ok.
    """
    told: Saved = {}
    for file in files:
        told = _section(file) or told
    verdict = told.get('verdict')
    if verdict not in VERDICTS:
        return {'Commissioned': NOT_YET}
    found = {'Commissioned': str(verdict)}
    for name, key in FOUND.items():
        share = told.get(key)
        if isinstance(share, int | float) and 0.0 < share < LARGEST:
            found[f'{name} change found within an hour (%)'] = f'{100.0 * share:.2g}'
    reasons = told.get('reasons')
    if isinstance(reasons, list) and reasons:
        found['Commissioned because'] = plain('; '.join(str(r) for r in reasons), SENTENCE)
    return found


def _section(file: Path) -> Saved:
    """Return what a file tells of the commissioning; {} where it cannot be read."""
    try:
        content: Plain = yaml.safe_load(file.read_text('utf-8'))
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return {}  # the middleware has read what parameters it needs, and refused a bad file
    return section(content, COMMISSION)
