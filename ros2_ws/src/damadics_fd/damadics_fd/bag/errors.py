# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The error that everything in `bag` raises."""

from pathlib import Path


class BagError(Exception):
    """
    A recording cannot be read or written; the text names the cause and, if any, the remedy.

    :param reason: one sentence for a person.
    :param path: the file concerned, if known.
    """

    def __init__(self, reason: str, path: str | Path | None = None):
        super().__init__(f'{path}: {reason}' if path else reason)
        self.reason = reason
        self.path = path


class NoMeasurementError(BagError):
    """A file can be read but holds no measurement of a valve."""
