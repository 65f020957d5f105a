# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Chunks and whole files, decompressed within limits."""

import os
import tempfile
from pathlib import Path
from typing import BinaryIO

import numpy as np
import zstandard
from numpy.typing import NDArray

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.crc import crc32
from damadics_fd.bag.mcap.records import ChunkHead, parse_chunk

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
_FOREIGN = {
    b'#ROSBAG ': 'is a ROS 1 bag; convert it: rosbags-convert --dst-storage mcap',
    b'PK\x03\x04': 'is a ZIP archive; unpack it first',
    b'\x1f\x8b': 'is compressed by gzip; unpack it first',
    b'\xd0\xcf\x11\xe0': 'is a file of Excel; save it as CSV',
    b'MATLAB 5': 'is a file of MATLAB; save it as CSV or Parquet: writetable',
    b'\x89HDF': 'is HDF5, as MATLAB writes it; save it as CSV or Parquet',
    b'ARROW1': 'is an Arrow file; save it as Parquet',
}
_SHEETS = ('.xlsx', '.xlsm', '.ods')  # ZIP archives, too


class Slot:
    """Memory for one chunk at a time: what is used again need not be mapped and cleared again."""

    def __init__(self) -> None:
        self._packed = bytearray()
        self._data = np.empty(0, np.uint8)
        self._zstd = zstandard.ZstdDecompressor()

    @property
    def size(self) -> int:
        """Memory that it holds [B]."""
        return len(self._packed) + len(self._data)

    def load(self, fd: int, at: int, length: int, limits: Limits) -> NDArray[np.uint8]:
        """
        Read the content of a Chunk record, decompress it and check its CRC.

        :param fd: file.
        :param at: place of the content.
        :param length: its length [B].
        :param limits: what it may ask for.
        :return: records of the chunk, to be used until the next `load`.
        :raises BagError: where it is damaged or asks for more.
        """
        if length > len(self._packed):
            self._packed = bytearray(length)
        content = memoryview(self._packed)[:length]
        if os.preadv(fd, [content], at) < length:
            raise BagError('ends in the middle of a record')
        chunk, packed = parse_chunk(content)
        if chunk.size > limits.chunk or chunk.size > max(1 << 16, limits.ratio * len(packed)):
            raise BagError(f'a chunk of {chunk.size} bytes from {len(packed)} is beyond the limit')
        if chunk.size > len(self._data):
            self._data = np.empty(chunk.size, np.uint8)
        data = self._data[: chunk.size]
        if self._decompress(chunk, packed, data.data) != chunk.size:
            raise BagError('a chunk is damaged: its size does not match')
        if chunk.crc and crc32(data) != chunk.crc:
            raise BagError('a chunk is damaged: its CRC does not match')
        return data

    def _decompress(self, chunk: ChunkHead, packed: memoryview, data: memoryview) -> int:
        """Fill `data`; return how much there is, which may be more."""
        if chunk.compression == 'zstd':
            try:
                return self._unzstd(packed, data)
            except zstandard.ZstdError as error:
                raise BagError('a chunk is damaged: it cannot be decompressed') from error
        plain: bytes | memoryview = packed
        if chunk.compression == 'lz4':
            plain = _lz4(packed, chunk.size)
        elif chunk.compression != '':
            raise BagError(f'a chunk has the unknown compression {chunk.compression[:20]!r}')
        if len(plain) == len(data):
            data[:] = plain
        return len(plain)

    def _unzstd(self, packed: memoryview, data: memoryview) -> int:
        one = zstandard.frame_content_size(packed) == len(data)  # nearly always; else any number
        reader = self._zstd.stream_reader(packed, read_across_frames=not one)
        done = 0
        while done < len(data) and (count := reader.readinto(data[done:])):
            done += count  # decompressed right into `data`
        return done if one else done + len(reader.read(1))


def _lz4(packed: memoryview, size: int) -> bytes:
    """Decompress frames one after the other, to at most one byte more than there should be."""
    try:
        import lz4.frame
    except ImportError as error:
        raise BagError('a chunk is compressed by lz4: pip install lz4') from error
    frames = lz4.frame.create_decompression_context()
    parts: list[bytes] = []
    at, left = 0, size + 1
    try:
        while at < len(packed) and left:
            part, read, _ = lz4.frame.decompress_chunk(frames, packed[at:], max_length=left)
            if not (part or read):
                break
            parts.append(part)
            at, left = at + read, left - len(part)
    except RuntimeError as error:
        raise BagError('a chunk is damaged: it cannot be decompressed') from error
    return b''.join(parts)


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
    if start.startswith(ZSTD_MAGIC):
        with stream:
            return unpacked(stream, path, limits)
    foreign = next((text for magic, text in _FOREIGN.items() if start.startswith(magic)), '')
    if foreign and path.suffix.lower() in _SHEETS:
        foreign = 'is a spreadsheet; save it as CSV'
    if foreign or not start:
        stream.close()
        raise BagError(foreign or 'is empty', path)
    return stream


def unpacked(stream: BinaryIO, path: Path, limits: Limits) -> BinaryIO:
    """
    Decompress a file that is compressed as a whole into a file without name.

    :param stream: the file, which stays open.
    :param path: its name.
    :param limits: what it may ask for.
    :raises BagError: where it asks for more, or the disk is full.
    """
    most = limits.unpacked + limits.unpacked_ratio * os.fstat(stream.fileno()).st_size
    stream.seek(0)
    plain: BinaryIO = tempfile.TemporaryFile()  # noqa: SIM115
    try:
        with zstandard.ZstdDecompressor().stream_reader(
            stream, read_across_frames=True, closefd=False
        ) as source:
            while block := source.read(1 << 20):
                if plain.tell() + len(block) > most:
                    raise BagError(
                        f'is larger than {most} bytes when decompressed; if it is yours,'
                        ' decompress it first: zstd -d',
                        path,
                    )
                plain.write(block)
        plain.flush()
    except zstandard.ZstdError:
        pass  # the reader reports where it ends
    except OSError as error:
        plain.close()
        raise BagError(f'cannot be decompressed: {error.strerror}', path) from error
    except BaseException:
        plain.close()
        raise
    plain.seek(0)
    return plain
