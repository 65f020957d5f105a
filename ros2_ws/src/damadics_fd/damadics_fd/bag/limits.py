# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a file may ask of the reader: a hostile one costs bounded memory and time."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """
    Largest sizes that are read; anything beyond is damage.

    :param record: content of one record [B].
    :param chunk: decompressed chunk [B].
    :param ratio: decompressed over compressed size of a chunk.
    :param text: all schemas and channels together [B].
    :param unpacked: a file that is compressed as a whole, decompressed [B].
    :param problems: number of damaged places after which the rest is given up.
    """

    record: int = 1 << 28
    chunk: int = 1 << 28
    ratio: int = 2000
    text: int = 1 << 26
    unpacked: int = 1 << 36
    problems: int = 10_000
