# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The records of a campaign as results.jsonl holds them."""

import math
from collections.abc import Mapping
from typing import Any, TypeAlias

Result: TypeAlias = dict[str, Any]  # one line of JSON
Limits: TypeAlias = dict[str, float]


def plain(values: Mapping[str, float | bool | None]) -> dict[str, float | bool | None]:
    """Return the values with None for NaN, as JSON has it."""
    return {
        key: None if isinstance(value, float) and math.isnan(value) else value
        for key, value in values.items()
    }
