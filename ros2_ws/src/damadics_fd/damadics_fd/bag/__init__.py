# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings: MCAP bags in and out, as columns."""

from damadics_fd.bag.columns import iter_columns, read_columns
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.writer import BagWriter, write_columns

__all__ = ['BagError', 'BagWriter', 'iter_columns', 'read_columns', 'write_columns']
