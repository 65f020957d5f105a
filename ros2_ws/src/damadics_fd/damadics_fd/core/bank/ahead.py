# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Bring the records of the next valve into the cache while the present one is judged.

The records of thousands of valves do not fit the cache; without this the loop waits for memory
for a third of its time. It changes no value.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.base import BaseContext
from numba.core.typing.context import BaseContext as Typing
from numba.core.typing.templates import Signature
from numba.extending import intrinsic

from damadics_fd.core.jit import layer, settings
from damadics_fd.core.record import Array, Ints

Lower = Callable[[BaseContext, ir.IRBuilder, Signature, Sequence[ir.Value]], ir.Value]
LINE = 64  # bytes of the cache that come at once
CACHE = 1 << 20  # bytes of records that a core's own cache holds: nothing is to be fetched ahead


class Part(NamedTuple):
    """Name the fields of each record of an array that a sample needs, as they lie in a row."""

    records: Array
    first: str = ''  # '': from the begin of the record
    last: str = ''  # '': up to the end of the record

    def bytes_of(self) -> tuple[int, int]:
        """
        Return where the fields lie.

        :return: the first byte in a record, and the one behind the last.
        """
        kind = self.records.dtype
        begin = _field(kind, self.first)[1] if self.first else 0
        last, end = _field(kind, self.last) if self.last else (kind, 0)
        return begin, end + last.itemsize


def _field(kind: np.dtype[np.void], name: str) -> tuple[np.dtype[np.generic], int]:
    """Return the kind of a field of a record, and where it begins [B]."""
    assert kind.fields is not None
    found, offset = kind.fields[name][:2]
    return found, offset


def places(parts: Iterable[Part]) -> Ints:
    """
    Say where the bytes are that a sample of a valve needs.

    :param parts: of arrays with a record of each valve, which stay where they are.
    :return: address for valve 0 and step from valve to valve, for each line of the cache, shape
        (lines, 2);
        none where the cache holds all.
    """
    found: list[tuple[int, int]] = []
    needed = 0
    for part in parts:
        first, behind = part.bytes_of()
        offsets = [*range(first, behind, LINE), behind - 1]  # a record may begin within a line
        start, size = part.records.ctypes.data, part.records.dtype.itemsize
        found += [(start + offset, size) for offset in offsets]
        needed += len(part.records) * len(offsets) * LINE
    return np.array(found if needed > CACHE else [], np.int64).reshape(-1, 2)


def _line(address: int) -> None:
    """Ask for one line of the cache; without a compiler there is nothing to ask."""


if not settings.DISABLE_JIT:

    @intrinsic
    def _line(typing: Typing, address: types.Type) -> tuple[Signature, Lower]:
        """Compile to the machine's instruction for that, which cannot fail at any address."""

        def lower(
            context: BaseContext,
            builder: ir.IRBuilder,
            signature: Signature,
            arguments: Sequence[ir.Value],
        ) -> ir.Value:
            pointer, number = ir.IntType(8).as_pointer(), ir.IntType(32)
            kind = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
            function = builder.module.declare_intrinsic('llvm.prefetch', [pointer], kind)
            at = builder.inttoptr(arguments[0], pointer)
            to_write, near, data = number(1), number(3), number(1)
            return builder.call(function, [at, to_write, near, data])

        return types.void(types.int64), lower


@layer
def fetch(where: Ints, v: int) -> None:
    """
    Ask for the records of a valve.

    :param where: as `places` returns it.
    :param v: which valve.
    """
    for k in range(len(where)):
        _line(where[k, 0] + v * where[k, 1])
