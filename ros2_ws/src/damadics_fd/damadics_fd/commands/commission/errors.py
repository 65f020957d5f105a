# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Why a valve cannot be commissioned."""


class CommissioningError(ValueError):
    """Tell why recordings cannot commission a valve, and what to do."""
