# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Columns: what a recording is in memory."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Column = NDArray[Any]  # numbers, texts, or rows of numbers: its type is that of the message
Columns = dict[str, Column]
Places = NDArray[np.int64]  # in the bytes of a chunk
