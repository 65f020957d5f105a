# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What only a thorough reading of an MCAP file finds: indexes, attachments, statistics."""

import struct
from collections.abc import Callable

import numpy as np

from damadics_fd.bag.batch import Batch
from damadics_fd.bag.mcap.records import HEAD, Extent, Op
from damadics_fd.bag.mcap.summary import Indexed, Summary

Read = Callable[[int, int], bytes]  # place, size
Tell = Callable[[int, str], None]  # place, what is wrong there


def check_message_index(read: Read, tell: Tell, indexed: Indexed, batch: Batch) -> None:
    """
    Compare the message indexes of a chunk with its messages.

    :param read: reads bytes of the file.
    :param tell: told what does not match.
    :param indexed: what the chunk index says.
    :param batch: the messages.
    """
    if not indexed.messages:
        return
    parts = dict(batch.by_channel())
    for number in parts.keys() - indexed.messages.keys():
        tell(batch.offset, f'the messages of channel {number} are missing in the message index')
    none = np.empty(0, np.int64)
    for number, at in indexed.messages.items():
        rows = parts.get(number, none)
        places = batch.places[rows]
        pairs = np.stack([batch.log_times(rows), places], axis=1).astype('<u8')
        content = struct.pack('<HI', number, pairs.nbytes)
        found = read(at, HEAD.size + len(content) + pairs.nbytes)
        op, length = HEAD.unpack_from(found) if len(found) >= HEAD.size else (0, 0)
        same = op == Op.MESSAGE_INDEX and length >= len(content) + pairs.nbytes
        same = same and found[HEAD.size : HEAD.size + 6] == content
        if same:  # the entries may be in any order
            listed = np.frombuffer(found[HEAD.size + 6 :], '<u8').reshape(-1, 2)
            listed = listed[np.argsort(listed[:, 1])]
            same = bool((listed == pairs).all())
        if not same:
            tell(at, 'the message index does not match the chunk')


def check_extras(tell: Tell, summary: Summary, extras: list[Extent], end: int) -> None:
    """
    Compare attachments and metadata with their index and number.

    :param tell: told what does not match.
    :param summary: what the end of the file says.
    :param extras: those that are there.
    :param end: place of the end of the data section.
    """
    places = {Op.ATTACHMENT: summary.attachments, Op.METADATA: summary.metadata}
    for op, listed in places.items():
        there = {extra.at: extra.length for extra in extras if extra.op == op}
        if listed and listed != there and not summary.moved:
            tell(end, f'the index of the {op.name.lower()} records does not match them')
        if summary.records:
            stated = summary.records[0 if op == Op.ATTACHMENT else 1]
            if stated != len(there):
                name = op.name.lower()
                tell(end, f'{len(there)} {name} records are there, the statistics say {stated}')
