# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Monitors of many valves in arrays, one compiled loop over their samples."""

from damadics_fd.core.bank.bank import Bank, Changes

__all__ = ['Bank', 'Changes']
