# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The one place that decides how a hot loop is compiled."""

import hashlib
import os
import shutil
import sys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

from damadics_fd.core.private import instead_of, writable

# numba takes in `coverage` wherever that is installed: a twentieth of a node's start, for nothing
UNUSED = 'coverage'
if UNUSED not in sys.modules:
    sys.modules[UNUSED] = None  # type: ignore[assignment]
    import numba

    del sys.modules[UNUSED]
else:
    import numba

F = TypeVar('F', bound=Callable[..., Any])
settings: Any = numba.config
njit: Any = numba.njit


CORE = Path(__file__).parent


@lru_cache
def _core() -> 'hashlib._Hash':
    """Return the digest of the core's sources, made once for all its rooms."""
    return hashlib.sha256(b''.join(p.read_bytes() for p in sorted(CORE.rglob('*.py'))))


@lru_cache
def _cache(folder: Path) -> str:
    # numba's own cache notices a change of the function's file, but not of the files of the
    # functions that it calls: a loop would go on with the steps of yesterday. So every state
    # of the sources has a cache of its own.
    digest = _core().copy()
    if not folder.is_relative_to(CORE):
        for source in sorted(folder.rglob('*.py')):
            digest.update(source.read_bytes())
    kept = folder / '__pycache__' / f'numba-{digest.hexdigest()[:16]}'
    return str(kept if writable(kept) else _private(kept))


def _private(kept: Path) -> Path:
    """Begin a cache of this user with what the installation has compiled."""
    chosen = instead_of(CORE.parent, 'compiled code') / f'{kept.parent.parent.name}-{kept.name}'
    if kept.is_dir() and not chosen.exists():
        part = chosen.with_name(f'{chosen.name}.{os.getpid()}')
        shutil.copytree(kept, part)
        part.rename(chosen) if not chosen.exists() else shutil.rmtree(part)
    return chosen


def jit(function: F, inline: str = 'never') -> F:
    """
    Compile a function with numba, keeping IEEE arithmetic in source order.

    Other threads run while it does.

    :param function: a function of scalars and arrays; its state is a structured array.
    :param inline: as in numba.
    :return: the compiled function. With `NUMBA_DISABLE_JIT=1` the same source runs uncompiled.
    """
    before = settings.CACHE_DIR
    settings.CACHE_DIR = before or _cache(Path(function.__code__.co_filename).parent)
    try:
        compiled = njit(
            cache=True,
            nogil=True,
            fastmath=False,
            error_model='numpy',
            inline=inline,
            no_cfunc_wrapper=True,
        )  # no C callbacks: compiles faster
        return cast(F, compiled(function))
    finally:
        settings.CACHE_DIR = before


def layer(function: F) -> F:
    """
    Compile a function into its only caller.

    numba compiles everything below a function once more with each function above it. For a
    function with much below and one caller this saves a second of compile time.

    :param function: as for `jit`.
    :return: as from `jit`.
    """
    return jit(function, 'always')
