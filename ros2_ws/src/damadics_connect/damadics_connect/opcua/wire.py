# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Read data changes from the bytes of OPC UA Binary (OPC 10000-6, 5.2.2.17 and 5.2.2.16).

asyncua makes six objects of each value and rounds its time to microseconds. A subscription that
carries thousands of values a second needs four numbers of each, and all of its time.
"""

import struct
from typing import NamedTuple

import numpy as np
from asyncua import ua
from asyncua.common.utils import Buffer
from asyncua.ua.ua_binary import variant_from_binary
from numpy.typing import NDArray

from damadics_connect.opcua.values import UNIX, node_id

VALUE, STATUS, SOURCE, SERVER, SOURCE_PICO, SERVER_PICO = (1 << n for n in range(6))
NUMBERS = {
    1: '?',
    2: 'b',
    3: 'B',
    4: '<i2',
    5: '<u2',
    6: '<i4',
    7: '<u4',
    8: '<i8',
    9: '<u8',
    10: '<f4',
    11: '<f8',
}
FORMATS = {1: '<?', 2: '<b', 3: '<B', 4: '<h', 5: '<H', 6: '<i', 7: '<I'} | {
    8: '<q',
    9: '<Q',
    10: '<f',
    11: '<d',
}
LEAST_ROWS = 8  # from where columns are faster than rows
DATA_CHANGE = node_id(ua.ObjectIds.DataChangeNotification_Encoding_DefaultBinary)


class Changes(NamedTuple):
    """Values that have changed, as columns of equal length."""

    handle: list[int]  # as given to the monitored item
    value: list[float]  # NaN where it is no number
    status: list[int]  # status code; 0: good
    stamp: list[int]  # source time [ns since 1970], 0: none
    kind: list[str]  # '' for a number, else what came instead

    def add(self, handle: int, value: float, status: int, stamp: int, kind: str) -> None:
        """Add one row."""
        self.handle.append(handle)
        self.value.append(value)
        self.status.append(status)
        self.stamp.append(stamp)
        self.kind.append(kind)


class WireError(ValueError):
    """The bytes are no data change."""


def keep_bytes() -> None:
    """Have asyncua hand over the bytes of data changes in this process, undecoded."""
    ua.extension_objects_by_typeid.pop(DATA_CHANGE, None)


def read_changes(body: bytes) -> Changes:
    """
    Read a `DataChangeNotification`.

    :param body: of the extension object.
    :return: the changes in the order of the message.
    :raises WireError: where the bytes are cut or wrong.
    """
    try:
        (count,) = struct.unpack_from('<i', body)
        if count <= 0:
            return Changes([], [], [], [], [])
        if count > len(body) // 5:
            raise WireError(f'{count} values announced in {len(body)} bytes')
        if count >= LEAST_ROWS and (columns := _alike(body, count)):
            return columns
        return _one_by_one(body, count)
    except (struct.error, IndexError, ua.UaError) as problem:
        raise WireError(f'a data change cannot be read: {problem}') from problem


def _alike(body: bytes, count: int) -> Changes | None:
    """Read rows that all have the layout of the first; None where they do not."""
    mask, kind = body[8], body[9]
    if not mask & VALUE or kind not in NUMBERS:
        return None
    fields = [('handle', '<u4'), ('mask', 'u1'), ('kind', 'u1'), ('value', NUMBERS[kind])]
    fields += [('status', '<u4')] * bool(mask & STATUS)
    fields += [('source', '<i8')] * bool(mask & SOURCE)
    fields += [('pico', '<u2')] * bool(mask & SOURCE_PICO)
    fields += [('server', '<i8')] * bool(mask & SERVER)
    fields += [('server_pico', '<u2')] * bool(mask & SERVER_PICO)
    layout = np.dtype(fields)
    if len(body) < 4 + count * layout.itemsize:
        return None
    rows = np.frombuffer(body, layout, count, 4)
    if (rows['mask'] != mask).any() or (rows['kind'] != kind).any():
        return None
    names = layout.names or ()
    status = rows['status'].tolist() if 'status' in names else [0] * count
    if 'source' in names:
        stamp = _nanoseconds(rows, 'source', 'pico')
    elif 'server' in names:
        stamp = _nanoseconds(rows, 'server', 'server_pico')
    else:
        stamp = [0] * count
    values = rows['value'].astype(np.float64).tolist()
    return Changes(rows['handle'].tolist(), values, status, stamp, [''] * count)


def _nanoseconds(rows: NDArray[np.void], ticks_of: str, fine_of: str) -> list[int]:
    ticks = rows[ticks_of]
    ns = (ticks - UNIX) * 100
    if fine_of in (rows.dtype.names or ()):
        ns = ns + rows[fine_of] // 100  # in units of 10 ps
    known: list[int] = np.where((ticks > UNIX) & (ticks < 2 * UNIX), ns, 0).tolist()
    return known


def _one_by_one(body: bytes, count: int) -> Changes:
    changes = Changes([], [], [], [], [])
    at = 4
    for _ in range(count):
        handle, mask = struct.unpack_from('<IB', body, at)
        at += 5
        value, word = float('nan'), 'no value'
        if mask & VALUE:
            kind = body[at]
            if kind in FORMATS:
                (number,) = struct.unpack_from(FORMATS[kind], body, at + 1)
                at += 1 + struct.calcsize(FORMATS[kind])
                value, word = float(number), ''
            else:
                rest = Buffer(body, at)
                variant = variant_from_binary(rest)
                at = len(body) - len(rest)
                word = 'an array' if kind & 0x80 else variant.VariantType.name
        status = source = server = 0
        if mask & STATUS:
            (status,) = struct.unpack_from('<I', body, at)
            at += 4
        for bit, pico, which in ((SOURCE, SOURCE_PICO, 0), (SERVER, SERVER_PICO, 1)):
            ticks = fine = 0
            if mask & bit:
                (ticks,) = struct.unpack_from('<q', body, at)
                at += 8
            if mask & pico:
                (fine,) = struct.unpack_from('<H', body, at)
                at += 2
            ns = (ticks - UNIX) * 100 + fine // 100 if UNIX < ticks < 2 * UNIX else 0
            source, server = (ns, server) if not which else (source, ns)
        changes.add(handle, value, status, source or server, word)
    return changes
