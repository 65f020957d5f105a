# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""CRC-32 as MCAP wants it; `isal` is five times as fast as zlib where it is installed."""

try:
    from isal.isal_zlib import crc32
except ImportError:
    from zlib import crc32

__all__ = ['crc32']
