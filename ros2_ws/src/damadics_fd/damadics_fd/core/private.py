# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A folder of this user alone, for users without a home that can be written."""

import os
import stat
import sys
import tempfile
from functools import lru_cache
from pathlib import Path


@lru_cache
def private_folder() -> Path:
    """
    Return a folder in the system's place for temporary files that nobody else can write.

    :return: the same folder for all processes of a user, while the machine runs; where somebody
        else has taken its name, one for this process.
    """
    folder = Path(tempfile.gettempdir(), f'damadics_fd-{os.getuid()}')
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if (
            stat.S_ISDIR(found.st_mode)
            and found.st_uid == os.getuid()
            and not found.st_mode & 0o077
        ):
            return folder
    except OSError:
        pass  # of somebody else
    return Path(tempfile.mkdtemp(prefix='damadics_fd-'))


@lru_cache
def instead_of(folder: Path, what: str) -> Path:
    """
    Choose the private folder, and say so once.

    :param folder: that cannot be written.
    :param what: what it would keep.
    :return: the private folder.
    """
    chosen = private_folder()
    print(
        f'damadics_fd: cannot keep {what} in {folder}, it is kept in {chosen} until the machine '
        'is started again',
        file=sys.stderr,
    )
    return chosen


def writable(folder: Path) -> bool:
    """
    Tell whether files can be made in a folder, or in what is there of its path.

    :param folder: it need not exist.
    :return: True if so.
    """
    try:
        while not folder.exists() and folder != folder.parent:
            folder = folder.parent
        return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)
    except PermissionError:
        return False
