# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A new file in which each write is complete or leaves no trace."""

import io
import os
from pathlib import Path

BLOCK = 1 << 20  # [B] copied at a time


class WholeWrites(io.RawIOBase):
    """
    A new file in which each write is complete or, where the disk is full, leaves no trace.

    :param path: file to create.
    :raises FileExistsError: where it is there already: no recording is ever overwritten.
    """

    def __init__(self, path: Path):
        self.path = path
        self._fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        self._end = 0

    def writable(self) -> bool:
        """Tell that the file can be written."""
        return True

    def write(self, data: bytes | bytearray | memoryview) -> int:  # type: ignore[override]
        """Append all of `data`."""
        view = memoryview(data).cast('B')
        done = 0
        try:
            while done < len(view):
                done += os.write(self._fd, view[done:])
        except OSError:
            os.ftruncate(self._fd, self._end)
            os.lseek(self._fd, self._end, os.SEEK_SET)
            raise
        self._end += done
        return done

    def restore(self) -> bool:
        """
        Write the file anew where somebody has removed it or its folder.

        :return: True where it was gone.
        """
        if self.closed or os.fstat(self._fd).st_nlink:
            return False
        self.path.parent.mkdir(parents=True, exist_ok=True)
        fresh = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        try:
            at = 0
            while data := os.pread(self._fd, BLOCK, at):
                at += os.write(fresh, data)
        except OSError:
            os.close(fresh)
            self.path.unlink()
            raise
        os.close(self._fd)
        self._fd = fresh
        return True

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            super().close()
            os.close(self._fd)
