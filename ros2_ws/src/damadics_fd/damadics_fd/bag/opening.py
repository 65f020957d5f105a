# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Open a file of messages by what is in it."""

from pathlib import Path

import zstandard

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.reader import McapFile
from damadics_fd.bag.mcap.unpack import ZSTD_MAGIC
from damadics_fd.bag.messages import MessageFile
from damadics_fd.bag.sqlite.reader import MAGIC, SqliteFile


def open_file(path: str | Path, tolerant: bool = False, limits: Limits = Limits()) -> MessageFile:
    """
    Open an MCAP file or an SQLite bag, either possibly compressed as a whole.

    :param path: the file.
    :param tolerant: read on behind damage and collect it in `problems`; otherwise it is an error.
    :param limits: what the file may ask for.
    :raises BagError: where it cannot be opened or is neither.
    """
    try:
        with Path(path).open('rb') as stream:
            start = stream.read(len(MAGIC))
            if start.startswith(ZSTD_MAGIC):
                stream.seek(0)
                reader = zstandard.ZstdDecompressor().stream_reader(stream, closefd=False)
                start = reader.read(len(MAGIC))
    except zstandard.ZstdError:
        start = b''
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise BagError(f'cannot be read: {reason}', path) from error
    kind = SqliteFile if start == MAGIC else McapFile
    return kind(path, tolerant, limits)
