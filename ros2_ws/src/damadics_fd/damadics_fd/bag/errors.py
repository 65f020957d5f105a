# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The error that everything in `bag` raises."""

import re
from pathlib import Path

LONGEST = 500  # characters of a text from a file that a message shows
_CONTROL = re.compile(r'[\x00-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2066-\u2069\ufeff]')


def printable(text: str) -> str:
    r"""
    Return a text from a file as a terminal may show it: without control characters, cut to size.

    >>> printable('/a\x1b[31m')
    '/a\\x1b[31m'
    """
    shown = text if len(text) <= LONGEST else text[:LONGEST] + ' ...'
    shown = shown.encode('utf-8', 'backslashreplace').decode()
    return _CONTROL.sub(lambda match: ascii(match[0])[1:-1], shown)


class BagError(Exception):
    """
    A recording cannot be read or written; the text names the cause and, if any, the remedy.

    :param reason: one sentence for a person.
    :param path: the file concerned, if known.
    """

    def __init__(self, reason: str, path: str | Path | None = None):
        reason = printable(reason)
        super().__init__(f'{printable(str(path))}: {reason}' if path else reason)
        self.reason = reason
        self.path = path


class NoMeasurementError(BagError):
    """A file can be read but holds no measurement of a valve."""
