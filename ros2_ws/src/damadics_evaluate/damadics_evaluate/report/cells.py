# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Figures as text."""

import math


def cell(value: float) -> str:
    """Return a figure in few characters, a dash where there is none."""
    if not math.isfinite(value):
        return '–'
    return f'{value:.0f}' if abs(value) >= 10 or value == int(value) else f'{value:.3g}'


def share(value: float) -> str:
    """Return a share in percent, a dash where there is none."""
    return '–' if math.isnan(value) else f'{value:.0%}'
