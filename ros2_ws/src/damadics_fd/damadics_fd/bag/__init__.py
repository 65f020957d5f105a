# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Recordings: MCAP bags in and out, as columns.

`read_columns` and `iter_columns` read a topic of any bag; `BagWriter` and `write_columns` write
one; `BagError` is the one error of them all.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from damadics_fd.bag.columns import iter_columns, read_columns
    from damadics_fd.bag.errors import BagError
    from damadics_fd.bag.writing.bag_writer import BagWriter
    from damadics_fd.bag.writing.columns_out import write_columns

__all__ = ['BagError', 'BagWriter', 'iter_columns', 'read_columns', 'write_columns']
_HOMES = {
    'BagError': 'errors',
    'BagWriter': 'writing.bag_writer',
    'write_columns': 'writing.columns_out',
    'iter_columns': 'columns',
    'read_columns': 'columns',
}


def __getattr__(name: str) -> Any:
    # on demand, because the recorder writes without the compiler that reading needs
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)
