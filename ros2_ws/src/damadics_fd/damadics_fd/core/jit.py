# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The one place that decides how a hot loop is compiled."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar('F', bound=Callable[..., Any])


def jit(function: F) -> F:
    """
    Compile a function with numba, keeping IEEE arithmetic in source order.

    :param function: a function of scalars and arrays; its state is a structured array.
    :return: the compiled function. With `NUMBA_DISABLE_JIT=1` the same source runs uncompiled.
    """
    return cast(F, njit(cache=True, fastmath=False, error_model='numpy')(function))
