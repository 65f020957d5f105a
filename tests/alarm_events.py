# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rows of the history for the tests of the page."""


def event(transition: int, text: str = 'raised', occurrence: int = 1, stamp: int = 5) -> dict:
    """Return what the page keeps of one transition."""
    return {
        'valve': 'lv101',
        'stamp': stamp,
        'transition': transition,
        'occurrence': occurrence,
        'level': 4,
        'onset': 4,
        'residual': 0.4,
        'threshold': 0.2,
        'ratio': 2.0,
        'duration': 1.0,
        'cause': 'friction',
        'confidence': None,
        'strength': 0.5,
        'text': text,
        'advice': 'look',
    }
