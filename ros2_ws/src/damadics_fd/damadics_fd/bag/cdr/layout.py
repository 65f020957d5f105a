# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
CDR, the serialisation of ROS 2 messages, by whole columns.

A message of which all strings and sequences keep their length has every field at a constant
place, so that many messages are one numpy structured array. `Layout` says where; it is found by
walking one message, and `Layout.matches` tells whether others may be read with it.

Encoding is plain CDR version 1: a four-byte header (byte order, options), then the fields, each
aligned to its own size counted from the end of that header.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Column
from damadics_fd.bag.cdr.definition import (
    DEEPEST,
    PRIMITIVES,
    Definition,
    parse_definition,
    schema_text,
)
from damadics_fd.bag.errors import BagError

HEADER = b'\x00\x01\x00\x00'  # plain CDR, little endian
HEADER_SIZE = len(HEADER)
MOST_ELEMENTS = 1 << 16  # places walked in one message; longer ones are no columns
NANO = 1_000_000_000


class Place(NamedTuple):
    """
    Where a field lies: `repeat` None is one value, otherwise an array.

    `text`: a string of `repeat` bytes, or a wstring of `repeat` words, each a unit of UTF-16.
    """

    name: str
    dtype: str
    offset: int
    repeat: int | None = None
    text: bool = False


@dataclass(frozen=True)
class Layout:
    """
    Places of all fields in a message of one size.

    :param places: fields by position; members of members have dotted names.
    :param lengths: offsets and values of the length words of all strings and sequences.
    :param size: size of the message with its header [B].
    :param order: byte order, `<` or `>`.
    """

    places: tuple[Place, ...]
    lengths: tuple[tuple[int, int], ...]
    size: int
    order: str = '<'

    def dtype(self, size: int | None = None) -> np.dtype:
        """
        Describe a message as a structured type, fields at their places.

        :param size: size of each message [B], at least that of the layout.
        """
        kinds = [
            f'S{place.repeat}'
            if place.dtype == 'S'
            else (
                self.order + place.dtype
                if place.repeat is None
                else (self.order + place.dtype, (place.repeat,))
            )
            for place in self.places
        ]
        return np.dtype(
            {
                'names': [place.name for place in self.places],
                'formats': kinds,
                'offsets': [place.offset for place in self.places],
                'itemsize': max(size or 0, self.size),
            }
        )

    def matches(self, messages: NDArray[np.uint8]) -> bool:
        """
        Tell whether all messages have their fields at the places of this layout.

        :param messages: (n, size) bytes.
        """
        if messages.shape[1] < self.size:
            return False
        order = 0 if self.order == '>' else 1
        if not ((messages[:, 0] == 0) & (messages[:, 1] == order)).all():
            return False
        for offset, value in self.lengths:
            word = np.ascontiguousarray(messages[:, offset : offset + 4]).view(self.order + 'u4')
            if not (word == value).all():
                return False
        return True


class _Walk:
    """Walk the members of a type, collecting places."""

    def __init__(self, definition: Definition, data: bytes, texts: Mapping[str, str] | None):
        self.definition = definition
        self.data = data
        self.texts = texts  # None: decode `data`; otherwise lay out an empty message
        self.order = '<' if texts is not None or data[1] == 1 else '>'
        self.at = HEADER_SIZE
        self.places: list[Place] = []
        self.lengths: list[tuple[int, int]] = []
        self.steps = 0

    def _reserve(self, size: int, align: int = 1) -> int:
        self.at += (HEADER_SIZE - self.at) % align
        start = self.at
        self.at += size
        if self.texts is None and self.at > len(self.data):
            raise BagError('a message is shorter than its definition says')
        return start

    def _length(self, name: str) -> int:
        offset = self._reserve(4, 4)
        if self.texts is None:
            (length,) = struct.unpack_from(self.order + 'I', self.data, offset)
        else:
            length = len(self.texts.get(name, '').encode()) + 1
        self.lengths.append((offset, length))
        return int(length)

    def walk(self, kind: str, prefix: str = '', depth: int = 0) -> None:
        """Add the places of one message."""
        if depth > DEEPEST:
            raise BagError(f'{kind} is nested more than {DEEPEST} deep, perhaps in itself')
        if not self.definition[kind] and (depth or self.at < len(self.data)):
            self._reserve(1)  # a struct needs a member in IDL: rosidl gives it an uint8
        for member in self.definition[kind]:
            name = prefix + member.name
            if member.repeat is None:
                self._one(name, member.type, depth)
                continue
            if member.repeat < 0 and self.texts is not None:
                raise BagError(f'{name} is a sequence; only messages of fixed size can be encoded')
            count = self._length(name) if member.repeat < 0 else member.repeat
            self._spend(1 if member.type in PRIMITIVES else count)
            if member.type in PRIMITIVES:
                code = PRIMITIVES[member.type]
                size = int(code[1])
                offset = self._reserve(size * count, size if count else 1)
                self.places.append(Place(name, code, offset, count))
            else:
                for i in range(count):
                    self._one(f'{name}.{i}', member.type, depth)

    def _spend(self, steps: int) -> None:
        self.steps += steps
        if self.steps > MOST_ELEMENTS:
            raise BagError(f'a message has more than {MOST_ELEMENTS} elements')

    def _one(self, name: str, kind: str, depth: int) -> None:
        self._spend(1)
        if kind in PRIMITIVES:
            code = PRIMITIVES[kind]
            size = int(code[1])
            self.places.append(Place(name, code, self._reserve(size, size)))
        elif kind == 'string':
            length = self._length(name)
            offset = self._reserve(length)
            self.places.append(Place(name, 'S', offset, max(length - 1, 0), text=True))
        elif kind == 'wstring':
            if self.texts is not None:
                raise BagError(f'{name} is a wstring; only string can be encoded')
            count = self._length(name)  # of UTF-16 units; each takes four bytes
            self.places.append(Place(name, 'u4', self._reserve(4 * count), count, text=True))
        else:
            self.walk(kind, name + '.', depth + 1)

    def layout(self) -> Layout:
        """Return what was collected."""
        return Layout(tuple(self.places), tuple(self.lengths), self.at, self.order)


def layout_of(definition: Definition, kind: str, message: bytes) -> Layout:
    """
    Find the places of the fields of one message.

    :param definition: types as `parse_definition` returns them.
    :param kind: type of the message.
    :param message: serialised message.
    :return: its layout, valid for all messages that it `matches`.
    :raises BagError: where the message is not plain CDR of this type.
    """
    if len(message) < HEADER_SIZE or message[0] != 0 or message[1] > 1:
        raise BagError('a message is not plain CDR; only XCDR version 1 can be read')
    walk = _Walk(definition, message, None)
    walk.walk(kind)
    return walk.layout()


class Encoder:
    """
    Serialises columns to stamped messages of fixed size.

    :param definition: types as `parse_definition` returns them.
    :param kind: type of the messages.
    :param texts: the constant value of each string field, empty if absent.
    :raises BagError: where the type has sequences.
    """

    def __init__(self, definition: Definition, kind: str, texts: Mapping[str, str]):
        walk = _Walk(definition, b'', texts)
        walk.walk(kind)
        self._kind = kind
        layout = walk.layout()
        self._dtype = layout.dtype()
        self._constant = np.zeros((1, layout.size), np.uint8)
        self._constant[0, :HEADER_SIZE] = list(HEADER)
        for offset, length in layout.lengths:
            self._constant[0, offset : offset + 4] = list(struct.pack('<I', length))
        for name, text in texts.items():
            self._constant.view(self._dtype)[name] = text.encode()

    def __call__(self, columns: Mapping[str, Column], stamp: NDArray[np.int64]) -> Column:
        """
        Serialise columns.

        :param columns: values by dotted field name, n of each.
        :param stamp: n values of `header.stamp` [ns].
        :return: n messages as a structured array, whose bytes are the messages one after the
            other.
        :raises BagError: where a column is no field.
        """
        messages: Column = np.repeat(self._constant, len(stamp), axis=0).view(self._dtype)[:, 0]
        header = {'header.stamp.sec': stamp // NANO, 'header.stamp.nanosec': stamp % NANO}
        for name, values in {**header, **columns}.items():
            if name not in (self._dtype.names or ()):
                raise BagError(f'{self._kind} has no field {name}')
            messages[name] = values
        return messages


@lru_cache(maxsize=64)
def stamped_encoder(kind: str, frame_id: str) -> Encoder:
    """
    Return the encoder of an installed type of messages with a header.

    :param kind: `package/msg/Type`.
    :param frame_id: `header.frame_id` of all messages.
    :return: the encoder.
    :raises BagError: where the type is not installed or has sequences.
    """
    definition = parse_definition(kind, schema_text(kind))
    return Encoder(definition, kind, {'header.frame_id': frame_id})
