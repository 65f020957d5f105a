# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings: MCAP bags in and out, as columns."""

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.writer import BagWriter, write_columns

__all__ = ['BagError', 'BagWriter', 'write_columns']
