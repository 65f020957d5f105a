# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Gather one field of many messages that have it at the same place."""

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.arrays import Column, Places
from damadics_fd.bag.cdr.kernels import Words
from damadics_fd.bag.cdr.layout import Layout, Place


def same_layout(words: Words, starts: Places, layout: Layout) -> NDArray[np.bool_]:
    """Tell which messages have their fields at the places of a layout."""
    same: NDArray[np.bool_] = words.w2[starts] == (0x0100 if layout.order == '<' else 0)
    for offset, value in layout.lengths:
        same &= _ordered(words.w4[starts + offset], layout.order) == value
    return same


def _ordered(values: Column, order: str) -> Column:
    return values if order == '<' else values.byteswap()


def time(words: Words, at: Places, order: str) -> NDArray[np.int64]:
    """Gather times [ns]."""
    seconds = _ordered(words.w4[at], order).view(np.int32).astype(np.int64)
    stamps: NDArray[np.int64] = seconds * 10**9 + _ordered(words.w4[at + 4], order)
    return stamps


def field(words: Words, starts: Places, place: Place, order: str) -> Column:
    """Gather any field: numbers, arrays, strings."""
    if place.text and place.dtype == 'u4':
        return _wide(words, starts, place, order)
    if place.text:
        width = place.repeat or 0
        rows = words.w1[starts[:, None] + (place.offset + np.arange(width))]
        return np.char.decode(
            rows.view(f'S{width}')[:, 0] if width else np.zeros(len(rows), 'S1'),
            'utf-8',
            'replace',
        )
    size = int(place.dtype[1])
    source: Column = words[(1, 2, 4, 8).index(size)]
    if place.repeat is None:
        return _ordered(source[starts + place.offset], order).view(place.dtype)
    at = starts[:, None] + (place.offset + size * np.arange(place.repeat))
    return _ordered(source[at], order).view(place.dtype)


def _wide(words: Words, starts: Places, place: Place, order: str) -> Column:
    """Gather a wstring, whose units of UTF-16 take four bytes each."""
    count = place.repeat or 0
    if not count:
        return np.zeros(len(starts), 'U1')
    units = _ordered(words.w4[starts[:, None] + (place.offset + 4 * np.arange(count))], order)
    texts = [row.tobytes().decode('utf-16-le', 'replace') for row in units.astype('<u2')]
    return np.array(texts, 'U')
