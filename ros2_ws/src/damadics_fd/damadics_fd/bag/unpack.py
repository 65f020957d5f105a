# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Decompression within limits."""

import tempfile
from pathlib import Path
from typing import BinaryIO

import zstandard

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.records import ChunkHead

_ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
_FOREIGN = {
    b'SQLite f': 'is an SQLite bag; convert it: ros2 bag convert with storage_id mcap',
    b'#ROSBAG ': 'is a ROS 1 bag; convert it: rosbags-convert --dst-storage mcap',
}


def decompress(head: ChunkHead, packed: memoryview, limits: Limits) -> bytes:
    """
    Return the records of a chunk.

    :param head: what the chunk says about itself.
    :param packed: its compressed records.
    :param limits: what it may ask for.
    :raises BagError: where it asks for more or does not hold what it says.
    """
    if head.size > limits.chunk or head.size > max(1 << 16, limits.ratio * len(packed)):
        raise BagError(f'a chunk of {head.size} bytes from {len(packed)} is beyond the limit')
    if head.compression == '':
        data = bytes(packed)
    elif head.compression == 'zstd':
        try:
            if zstandard.frame_content_size(packed) not in (head.size, -1):
                raise BagError('a chunk is damaged: its size does not match')
            decompressor = zstandard.ZstdDecompressor()
            data = decompressor.decompress(packed, max_output_size=max(head.size, 1))
        except zstandard.ZstdError as error:
            raise BagError('a chunk is damaged: it cannot be decompressed') from error
    elif head.compression == 'lz4':
        data = _lz4(packed, head.size)
    else:
        raise BagError(f'a chunk has the unknown compression {head.compression[:20]!r}')
    if len(data) != head.size:
        raise BagError('a chunk is damaged: its size does not match')
    return data


def _lz4(packed: memoryview, size: int) -> bytes:
    try:
        import lz4.frame
    except ImportError as error:
        raise BagError('a chunk is compressed by lz4: pip install lz4') from error
    try:
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size))
    except RuntimeError as error:
        raise BagError('a chunk is damaged: it cannot be decompressed') from error


def open_plain(path: Path, limits: Limits) -> BinaryIO:
    """
    Open an MCAP file; one that is compressed as a whole is first decompressed.

    :param path: file.
    :param limits: what it may ask for.
    :raises BagError: where it cannot be opened or is something else.
    """
    try:
        stream = path.open('rb')
        start = stream.read(8)
    except OSError as error:
        raise BagError(f'cannot be read: {error.strerror}', path) from error
    if start.startswith(_ZSTD_MAGIC):
        with stream:
            return _unpacked(stream, path, limits)
    if not start or start in _FOREIGN:
        stream.close()
        raise BagError(_FOREIGN.get(start, 'is empty'), path)
    return stream


def _unpacked(stream: BinaryIO, path: Path, limits: Limits) -> BinaryIO:
    stream.seek(0)
    plain: BinaryIO = tempfile.TemporaryFile()  # type: ignore[assignment]  # noqa: SIM115
    try:
        with zstandard.ZstdDecompressor().stream_reader(stream, read_across_frames=True) as source:
            while block := source.read(1 << 20):
                if plain.tell() + len(block) > limits.unpacked:
                    raise BagError('is beyond the size limit when decompressed', path)
                plain.write(block)
    except zstandard.ZstdError:
        pass  # the reader reports where it ends
    except BaseException:
        plain.close()
        raise
    plain.flush()
    return plain
