# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Recordings: MCAP bags in and out, as columns.

`read_columns` and `iter_columns` read a topic of any bag; `BagWriter` and `write_columns` write
one; `BlockReader` reads blocks of many valves, `write_parquet` makes a table of them; `BagError`
is the one error of them all.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damadics_fd.bag.blocks.reader import BlockReader
    from damadics_fd.bag.columns import iter_columns, read_columns
    from damadics_fd.bag.errors import BagError
    from damadics_fd.bag.tables.parquet_out import write_parquet
    from damadics_fd.bag.writing.bag_writer import BagWriter
    from damadics_fd.bag.writing.columns_out import write_columns

__all__ = [
    'BagError',
    'BagWriter',
    'BlockReader',
    'iter_columns',
    'read_columns',
    'write_columns',
    'write_parquet',
]
_HOMES = {
    'BagError': 'errors',
    'BagWriter': 'writing.bag_writer',
    'BlockReader': 'blocks.reader',
    'write_columns': 'writing.columns_out',
    'write_parquet': 'tables.parquet_out',
    'iter_columns': 'columns',
    'read_columns': 'columns',
}


def __getattr__(name: str) -> Any:
    # on demand, because the recorder writes without the compiler that reading needs
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)
