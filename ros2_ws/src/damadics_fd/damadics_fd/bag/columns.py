# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Read a topic of a bag as columns, by whole chunks instead of message by message.

>>> from damadics_fd.bag import read_columns
>>> columns = read_columns('friction.mcap', '/measurement', ['cv', 'x1'])  # doctest: +SKIP
>>> sorted(columns)                                                        # doctest: +SKIP
['cv', 'log_time', 'stamp', 'x1']
"""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.cdr import kernels
from damadics_fd.bag.cdr.decoder import Columns, Decoder, join
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.reader import McapFile
from damadics_fd.bag.sources import bag_files

kernels.warm_up()  # here rather than with the first file
MOST_PER_BYTE = 2  # messages that a file may announce before memory is taken for them


def read_columns(
    path: str | Path,
    topic: str = '/measurement',
    fields: Sequence[str] | None = None,
    *,
    on_problem: Callable[[str], None] | None = None,
    limits: Limits = Limits(),
) -> Columns:
    """
    Read one topic of a bag.

    :param path: MCAP file or bag directory.
    :param topic: name of the topic.
    :param fields: fields to read; None for all that are numbers. Members of members have dotted
        names, `frame_id` is that of the header.
    :param on_problem: told each damaged place, which is then left out; None makes it an error.
    :param limits: what the file may ask for.
    :return: `log_time` and, where the message has a header, `stamp` (int64, ns); the fields by
        name in the type of the message, times as int64 [ns], arrays as rows of a matrix. All in
        the order of the file.
    :raises BagError: where the bag cannot be read, lacks the topic or a field.
    """
    whole = _read_whole(path, topic, fields, limits)
    if whole is not None:
        return whole
    parts = list(iter_columns(path, topic, fields, on_problem=on_problem, limits=limits))
    names = parts[0].keys()
    if len(parts) == 1:
        return parts[0]
    return {name: join([part[name] for part in parts if name in part]) for name in names}


def _read_whole(
    path: str | Path, topic: str, fields: Sequence[str] | None, limits: Limits
) -> Columns | None:
    """
    Read a finished file of which all messages are alike into one block of memory.

    :return: None where anything is out of the ordinary; the general way then has its say.
    """
    files = bag_files(path)
    if len(files) != 1:
        return None
    with McapFile(files[0], limits=limits) as mcap:
        name = '/' + topic.lstrip('/')
        numbers = [channel.id for channel in mcap.channels.values() if channel.topic == name]
        total = mcap.summary.counts.get(numbers[0], 0) if len(numbers) == 1 else 0
        if not 0 < total < MOST_PER_BYTE * files[0].stat().st_size:
            return None
        try:
            return Decoder(mcap, numbers[0], fields).decode_all(total)
        except BagError:
            return None


def iter_columns(
    path: str | Path,
    topic: str = '/measurement',
    fields: Sequence[str] | None = None,
    *,
    on_problem: Callable[[str], None] | None = None,
    limits: Limits = Limits(),
) -> Iterator[Columns]:
    """
    Read one topic of a bag chunk by chunk, in memory that does not grow with the bag.

    Parameters as for `read_columns`.

    :return: the columns of each chunk, at least once.
    :raises BagError: as `read_columns`.
    """
    topic = '/' + topic.lstrip('/')
    seen: set[str] = set()
    empty: Columns | None = None
    delivered = False
    for mcap in open_files(path, on_problem, limits):
        decoders: dict[int, Decoder] = {}
        for at, data in mcap.chunks():
            for columns in _decoded(mcap, at, data, topic, fields, decoders):
                delivered = True
                yield columns
        seen |= {channel.topic for channel in mcap.channels.values()}
        if on_problem:
            for problem in mcap.problems:
                on_problem(f'{mcap.path}: {problem.text} (at byte {problem.offset})')
        for channel in mcap.channels.values():
            if channel.topic == topic:
                empty = Decoder(mcap, channel.id, fields).empty()
    if not delivered:
        if empty is None:
            raise BagError(
                f'has no topic {topic}; it has {", ".join(sorted(seen)) or "none"}', path
            )
        yield empty


def open_files(
    path: str | Path,
    on_problem: Callable[[str], None] | None,
    limits: Limits = Limits(),
) -> Iterator[McapFile]:
    """
    Open the files of a bag one after the other.

    :param path: MCAP file or bag directory.
    :param on_problem: told which of several files is none, as a crash or a full disk may leave
        one; None makes it an error, and damage within the files, too.
    :param limits: what the files may ask for.
    :raises BagError: where the bag cannot be opened.
    """
    files = bag_files(path)
    for file in files:
        try:
            mcap = McapFile(file, on_problem is not None, limits)
        except BagError as error:
            if on_problem is None or len(files) == 1:
                raise
            on_problem(str(error))
            continue
        with mcap:
            yield mcap


def _decoded(
    mcap: McapFile,
    at: int,
    data: NDArray[np.uint8],
    topic: str,
    fields: Sequence[str] | None,
    decoders: dict[int, Decoder],
) -> Iterator[Columns]:
    """Decode the messages of a topic in a chunk; `decoders` gets those of its channels."""
    _note_channels(mcap, topic, fields, decoders)
    if len(decoders) == 1:
        columns = next(iter(decoders.values())).decode_alike(data)
        if columns:
            if len(columns['log_time']):
                yield columns
            return
    batch = mcap.index(data, at)
    _note_channels(mcap, topic, fields, decoders)
    for number, decoder in decoders.items():
        rows = batch.channels == number
        if rows.any():
            yield decoder.decode(batch, batch.starts[rows], batch.sizes[rows])


def _note_channels(
    mcap: McapFile, topic: str, fields: Sequence[str] | None, decoders: dict[int, Decoder]
) -> None:
    for channel in mcap.channels.values():
        if channel.topic == topic and channel.id not in decoders:
            decoders[channel.id] = Decoder(mcap, channel.id, fields)
