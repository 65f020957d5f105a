# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The lists of valves that a bag with blocks of many valves holds."""

import struct
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from damadics_fd.bag.cdr.decoder import Decoder
from damadics_fd.bag.cdr.definition import full_name
from damadics_fd.bag.cdr.layout import Layout, layout_of
from damadics_fd.bag.columns import open_files
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.messages import MessageFile

BLOCK = 'damadics_msgs/msg/MeasurementBlock'
LAYOUT = 'damadics_msgs/msg/FleetLayout'
BLOCK_TOPIC, LAYOUT_TOPIC = 'measurement_block', 'fleet/layout'
Told = Callable[[str], None]


class Valves(NamedTuple):
    """What one layout names, in the order of its indices."""

    names: tuple[str, ...]  # namespaces, each with a slash in front
    tags: tuple[str, ...]


Layouts = dict[int, Valves]  # by version


def layout_topic(block_topic: str) -> str:
    """
    Return the topic that says which valves the blocks of a topic name.

    >>> layout_topic('/north/measurement_block')
    '/north/fleet/layout'
    """
    return block_topic.rpartition('/')[0] + '/' + LAYOUT_TOPIC


def read_layouts(
    path: str | Path, topic: str, on_problem: Told | None, limits: Limits = Limits()
) -> Layouts:
    """
    Read the layouts that the blocks of a topic refer to.

    :param path: MCAP file, bag directory, SQLite bag.
    :param topic: of the blocks.
    :param on_problem: told what is damaged or contradicts itself; None makes it an error.
    :param limits: what the files may ask for.
    :return: those of the topic beside that of the blocks; where there is none, all of the bag.
    :raises BagError: where the bag cannot be read.
    """
    by_topic: dict[str, Layouts] = {}
    refused: set[tuple[str, int]] = set()
    silent: list[str] = []  # damage is told when the blocks are read
    for file in open_files(path, None if on_problem is None else silent.append, limits):
        for name, version, valves in _in_file(file, on_problem):
            known = by_topic.setdefault(name, {})
            if (name, version) in refused or known.get(version, valves) == valves:
                known[version] = valves
                continue
            refused.add((name, version))
            _tell(
                f'{name}: two lists of valves have the number {version}: none of them counts',
                path,
                on_problem,
            )
    for name, version in refused:
        del by_topic[name][version]
    beside = layout_topic(topic)
    for name in (beside, beside.lstrip('/')):
        if name in by_topic:
            return by_topic[name]
    return {version: valves for one in by_topic.values() for version, valves in one.items()}


def _tell(text: str, path: str | Path, on_problem: Told | None) -> None:
    if on_problem is None:
        raise BagError(text, path)
    on_problem(f'{path}: {text}')


def _in_file(file: MessageFile, on_problem: Told | None) -> Iterator[tuple[str, int, Valves]]:
    """Yield topic, version and valves of the layouts of a file, and read no further."""
    left: int | None = None
    if file.stated and file.channels:
        left = sum(file.stated.get(number, 0) for number in _channels(file))
        if not left:
            return
    decoders: dict[int, Decoder] = {}
    for at, data in file.chunks():
        batch = file.index(data, at)
        for number in _channels(file):
            for row in (batch.channels == number).nonzero()[0].tolist():
                try:
                    if number not in decoders:
                        decoders[number] = Decoder(file, number, None)
                    decoder, message = decoders[number], batch.message(row)
                    layout = layout_of(decoder.definition, decoder.kind, message)
                    yield decoder.topic, *_valves(layout, message)
                except BagError as error:
                    _tell(f'a list of valves is left: {error.reason}', file.path, on_problem)
                left = None if left is None else left - 1
        if left is not None and left <= 0:
            return


def _channels(file: MessageFile) -> Sequence[int]:
    return [
        channel.id
        for channel in file.channels.values()
        if (schema := file.schemas.get(channel.schema_id)) and full_name(schema.name) == LAYOUT
    ]


def _valves(layout: Layout, message: bytes) -> tuple[int, Valves]:
    texts: dict[str, list[str]] = {'valve': [], 'actuator': []}
    version = -1
    for place in layout.places:
        base, _, element = place.name.partition('.')
        if place.name == 'version' and place.dtype == 'u4':
            (version,) = struct.unpack_from(layout.order + 'I', message, place.offset)
        elif base in texts and element.isdigit() and place.text and place.dtype == 'S':
            raw = message[place.offset : place.offset + (place.repeat or 0)]
            texts[base].append(raw.decode('utf-8', 'replace'))
    names = tuple('/' + name.strip('/') for name in texts['valve'])
    if version < 0 or not names or len(set(names)) != len(names):
        raise BagError(
            f'the layout {version} names no valve, or one of them twice'
            if version >= 0
            else 'it has no version'
        )
    tags = texts['actuator'] if len(texts['actuator']) == len(names) else [''] * len(names)
    return version, Valves(names, tuple(tags))
