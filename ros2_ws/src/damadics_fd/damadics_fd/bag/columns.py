# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Read a topic of a bag as columns, by whole chunks instead of message by message.

>>> from damadics_fd.bag import read_columns
>>> columns = read_columns('friction.mcap', '/measurement', ['cv', 'x1'])  # doctest: +SKIP
>>> sorted(columns)                                                        # doctest: +SKIP
['cv', 'log_time', 'stamp', 'x1']
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Columns
from damadics_fd.bag.cdr import kernels
from damadics_fd.bag.cdr.decoder import Decoder, join, merge
from damadics_fd.bag.errors import BagError, printable
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.messages import MessageFile
from damadics_fd.bag.opening import open_file
from damadics_fd.bag.sources import bag_files, missing_files

kernels.warm_up()  # here rather than with the first file
SHOWN = 20  # topics named in a message
MOST_PER_BYTE = 2  # messages that a file may announce before memory is taken for them


def read_columns(
    path: str | Path,
    topic: str = '/measurement',
    fields: Sequence[str] | None = None,
    *,
    valve: str = '',
    on_problem: Callable[[str], None] | None = None,
    limits: Limits = Limits(),
) -> Columns:
    """
    Read one topic of a bag.

    :param path: MCAP file or bag directory.
    :param topic: name of the topic.
    :param fields: fields to read; None for all that are numbers. Members of members have dotted
        names, `frame_id` is that of the header.
    :param valve: namespace of a valve: of blocks of many valves (`MeasurementBlock`), the rows of
        this one, as if it had a topic of its own.
    :param on_problem: told each damaged place, which is then left out; None makes it an error.
    :param limits: what the file may ask for.
    :return: `log_time` and, where the message has a header, `stamp` (int64, ns); the fields by
        name in the type of the message, times as int64 [ns], arrays as rows of a matrix. All in
        the order of the file.
    :raises BagError: where the bag cannot be read, lacks the topic or a field.
    """
    whole = None if valve else _read_whole(path, topic, fields, limits)
    if whole is not None:
        return whole
    parts = list(
        iter_columns(path, topic, fields, valve=valve, on_problem=on_problem, limits=limits)
    )
    if len(parts) == 1:
        return parts[0]
    names = [name for name in parts[0] if all(name in part for part in parts)]
    return {name: join([part[name] for part in parts]) for name in names}


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
    try:
        with open_file(files[0], limits=limits) as file:
            name = resolved(topic, file)
            numbers = [channel.id for channel in file.channels.values() if channel.topic == name]
            total = file.stated.get(numbers[0], 0) if len(numbers) == 1 else 0
            if not 0 < total < MOST_PER_BYTE * files[0].stat().st_size:
                return None
            return Decoder(file, numbers[0], fields).decode_all(total)
    except BagError:
        return None


def iter_columns(
    path: str | Path,
    topic: str = '/measurement',
    fields: Sequence[str] | None = None,
    *,
    valve: str = '',
    on_problem: Callable[[str], None] | None = None,
    limits: Limits = Limits(),
) -> Iterator[Columns]:
    """
    Read one topic of a bag chunk by chunk, in memory that does not grow with the bag.

    Parameters as for `read_columns`.

    :return: the columns of each chunk, at least once.
    :raises BagError: as `read_columns`.
    """
    if valve:
        from damadics_fd.bag.blocks.reader import (
            valve_columns,  # which reads blocks with this function
        )

        yield from valve_columns(path, topic, valve, fields, on_problem, limits)
        return
    seen: set[str] = set()
    empty: Columns | None = None
    delivered = False
    for file in open_files(path, on_problem, limits):
        decoders: dict[int, Decoder] = {}
        counts: Counter[int] = Counter()
        for at, data in file.chunks():
            columns = _decoded(file, at, data, topic, fields, decoders, counts)
            if columns and len(columns['log_time']):
                delivered = True
                yield columns
        seen |= {channel.topic for channel in file.channels.values()}
        name = resolved(topic, file)
        numbers = [channel.id for channel in file.channels.values() if channel.topic == name]
        file.topic_counts({number: counts[number] for number in numbers}, one_text=True)
        if on_problem:
            for text in file.told():
                on_problem(text)
        for number in numbers:
            empty = Decoder(file, number, fields).empty()
    if not delivered:
        if empty is None:
            raise BagError(f'has no topic {topic}; it has {listing(seen)}', path)
        yield empty


def resolved(topic: str, file: MessageFile) -> str:
    """Return a topic as the file has it: exactly as given, or with or without a slash in front."""
    names = {channel.topic for channel in file.channels.values()}
    bare = topic.lstrip('/')
    return next((name for name in (topic, '/' + bare, bare) if name in names), topic)


def listing(names: Iterable[str]) -> str:
    """Name topics for a person, the first few of many."""
    names = sorted(names)
    more = f' and {len(names) - SHOWN} more' if len(names) > SHOWN else ''
    return printable(', '.join(names[:SHOWN])) + more if names else 'none'


def open_files(
    path: str | Path,
    on_problem: Callable[[str], None] | None,
    limits: Limits = Limits(),
) -> Iterator[MessageFile]:
    """
    Open the files of a bag one after the other.

    :param path: file or bag directory.
    :param on_problem: told which of several files is none, as a crash or a full disk may leave
        one; None makes it an error, and damage within the files, too.
    :param limits: what the files may ask for.
    :raises BagError: where the bag cannot be opened.
    """
    files = bag_files(path)
    for text in missing_files(path):
        if on_problem is None:
            raise BagError(text, path)
        on_problem(f'{path}: {text}')
    for name in files:
        try:
            file = open_file(name, on_problem is not None, limits)
        except BagError as error:
            if on_problem is None or len(files) == 1:
                raise
            on_problem(str(error))
            continue
        with file:
            yield file


def _decoded(
    file: MessageFile,
    at: int,
    data: NDArray[np.uint8],
    topic: str,
    fields: Sequence[str] | None,
    decoders: dict[int, Decoder],
    counts: Counter[int],
) -> Columns | None:
    """Decode the messages of a topic in a chunk; `decoders` and `counts` are by channel."""
    _note_channels(file, topic, fields, decoders)
    if len(decoders) == 1:
        number, decoder = next(iter(decoders.items()))
        columns = decoder.decode_alike(data)
        if columns:
            counts[number] += len(columns['log_time'])
            return columns
    batch = file.index(data, at)
    _note_channels(file, topic, fields, decoders)
    groups = []
    for number, decoder in decoders.items():
        rows = np.flatnonzero(batch.channels == number)
        if len(rows):
            counts[number] += len(rows)
            groups.append((rows, decoder.decode(batch, batch.starts[rows], batch.sizes[rows])))
    return merge(groups) if groups else None


def _note_channels(
    file: MessageFile, topic: str, fields: Sequence[str] | None, decoders: dict[int, Decoder]
) -> None:
    if len(file.channels) == len(decoders):
        return
    name = resolved(topic, file)
    for channel in file.channels.values():
        if channel.topic == name and channel.id not in decoders:
            decoders[channel.id] = Decoder(file, channel.id, fields)
    kinds = sorted({decoder.kind for decoder in decoders.values()})
    if len(kinds) > 1:
        raise BagError(f'{name} holds messages of several types: {", ".join(kinds)}', file.path)
