# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages that were compressed one by one, as rosbag2 does with `compression_mode: message`."""

import zstandard

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.unpack import ZSTD_MAGIC

UNSTATED = 1 << 24  # [B] at most, where a compressed message does not say its size


def is_compressed(message: bytes) -> bool:
    """Tell whether a message is compressed: no CDR begins like this."""
    return message[:4] == ZSTD_MAGIC


class Unpacker:
    """
    Decompress the messages of a file.

    :param limits: what the file may ask for.
    :param size: of the file [B].
    """

    def __init__(self, limits: Limits, size: int):
        self._most = limits.message
        self._left = limits.unpacked + limits.unpacked_ratio * size
        self._zstd = zstandard.ZstdDecompressor()

    def size(self, message: bytes) -> int:
        """
        Return how large a message is, or says that it is, when decompressed [B].

        :raises BagError: where it is damaged or asks for more than it may.
        """
        if not is_compressed(message):
            return len(message)
        try:
            size = zstandard.frame_content_size(message)
        except zstandard.ZstdError as error:
            raise BagError('a compressed message is damaged') from error
        if size > self._most:
            raise BagError(f'a message of {size} bytes is beyond the limit')
        return UNSTATED if size < 0 else size

    def __call__(self, message: bytes) -> bytes:
        """
        Return a message as it was before.

        :raises BagError: as `size`.
        """
        if not is_compressed(message):
            return message
        most = self.size(message)
        if most > self._left:
            raise BagError('the messages unpack to more than the limit: the rest is left')
        try:
            plain = self._zstd.decompress(message, max_output_size=most)
        except zstandard.ZstdError as error:
            raise BagError('a compressed message is damaged') from error
        self._left -= len(plain)
        return plain
