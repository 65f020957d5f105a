# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Compress chunks so that no reader takes them for an attack."""

import zstandard

DENSE = 200  # content of a chunk for each compressed byte, from which on it looks like a bomb


class Packer:
    """
    Compress chunks.

    One that would get very small (a blank image, an empty map) is compressed in blocks of a
    kilobyte, none of which gets smaller than four bytes.

    :param level: zstd compression level.
    """

    def __init__(self, level: int):
        self._usual = zstandard.ZstdCompressor(level=level)
        blocks = zstandard.ZstdCompressionParameters.from_level(1, window_log=10)
        self._sparse = zstandard.ZstdCompressor(compression_params=blocks)

    def __call__(self, content: bytes) -> bytes:
        """Return the records of a chunk, compressed."""
        packed = self._usual.compress(content)
        dense = len(content) > DENSE * len(packed)
        return self._sparse.compress(content) if dense else packed
