# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a file may ask of the reader: a hostile one costs bounded memory and time."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """
    Largest sizes that are read; anything beyond is damage.

    :param record: content of one record that is kept in memory [B].
    :param chunk: decompressed chunk [B].
    :param messages: in one chunk.
    :param message: one that is compressed by itself, decompressed [B].
    :param ratio: decompressed over compressed size of a chunk; zstd cannot exceed it by much.
    :param dense: a chunk that holds more bytes for each of its compressed ones is dense; our
        writer writes none.
    :param total: all dense chunks of a file together, decompressed [B].
    :param text: all schemas, channels and metadata together [B].
    :param channels: in one file.
    :param attachments: attachments and metadata records in one file.
    :param yaml: `metadata.yaml` or a text of quality of service [B].
    :param unpacked: a file that is compressed as a whole or message by message: so many bytes
        whatever its size,
    :param unpacked_ratio: and so many more for each of its bytes.
    :param walked: fields of messages that are looked at one by one, in a file of any size,
    :param walked_ratio: and so many more for each of its bytes.
    :param problems: number of damaged places after which the rest is given up.
    """

    record: int = 1 << 28
    chunk: int = 1 << 28
    messages: int = 1 << 22
    message: int = 1 << 26
    ratio: int = 1 << 17
    dense: int = 300
    total: int = 3 << 29
    text: int = 1 << 24
    channels: int = 10_000
    attachments: int = 20_000
    yaml: int = 1 << 20
    unpacked: int = 1 << 28
    unpacked_ratio: int = 300
    walked: int = 1 << 20
    walked_ratio: int = 4
    problems: int = 10_000
