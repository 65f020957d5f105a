# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a study tells, fit for JSON."""

from typing import TypeAlias

from damadics_fd.core.record import Json

Told: TypeAlias = dict[str, Json]
