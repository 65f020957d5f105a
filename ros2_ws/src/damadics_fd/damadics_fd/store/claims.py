# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Files that one process at a time may write: a second one is told, and leaves them alone."""

import errno
import fcntl
import hashlib
import os
from pathlib import Path

NAME = '.claims'  # a file in each folder; a byte of it is locked for each file that is claimed
_opened: dict[Path, int] = {}  # descriptors of this process: closing one would end its claims


def claim(path: Path) -> bool:
    """
    Claim a file for this process until it ends, however it ends.

    :param path: of the file; its folder is made where it is missing.
    :return: False where another process of this machine has claimed it.
    :raises OSError: where the folder cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    number = _descriptor(path.parent / NAME)
    place = int.from_bytes(hashlib.sha256(path.name.encode()).digest()[:7], 'big')
    try:
        fcntl.lockf(number, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
    except OSError as problem:  # a file system without locks refuses nobody
        return problem.errno not in (errno.EACCES, errno.EAGAIN)
    return True


def _descriptor(file: Path) -> int:
    """Open the file of claims, once while it is there."""
    number = _opened.get(file, -1)
    try:
        if number >= 0 and os.path.samestat(os.fstat(number), file.lstat()):
            return number
    except FileNotFoundError:
        pass
    if number >= 0:
        os.close(_opened.pop(file))
    _opened[file] = os.open(file, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    return _opened[file]
