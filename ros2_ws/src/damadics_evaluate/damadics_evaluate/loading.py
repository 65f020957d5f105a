# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Load what a user names on the command line: FILE.py:NAME, MODULE:NAME."""

import hashlib
import importlib
import importlib.util
import sys
from functools import cache
from pathlib import Path


@cache
def load_object(name: str) -> object:
    """
    Return an object of a file or module.

    :param name: FILE.py:NAME, or MODULE:NAME for what is installed.
    :return: the object.
    :raises ValueError: where there is no such file or object, or the file cannot be imported.
    """
    place, _, wanted = name.rpartition(':')
    if not place or not wanted.isidentifier():
        raise ValueError(f'{name}: give FILE.py:NAME or MODULE:NAME')
    try:
        if place.endswith('.py'):
            module = _module_of(Path(place))
        else:
            module = importlib.import_module(place)
    except ValueError:
        raise
    except (Exception, SystemExit) as error:
        # any error of the user's file is the user's to see, in one line
        raise ValueError(f'{place} cannot be imported: {told(error)}') from error
    if not hasattr(module, wanted):
        there = [key for key, v in vars(module).items() if isinstance(v, type)]
        raise ValueError(f'{place} has no {wanted}; it has {", ".join(there) or "no class"}')
    loaded: object = getattr(module, wanted)
    return loaded


def _module_of(file: Path) -> object:
    if not file.exists():
        raise ValueError(f'there is no file {file}')
    path = file.resolve()
    mark = hashlib.sha256(str(path).encode()).hexdigest()[:8]
    name = f'own_{path.stem}_{mark}'
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ValueError(f'{file} is no Python file')
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and pickling look it up there
    sys.path.insert(0, str(path.parent))  # so that it may import its neighbours
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(path.parent))
    return module


def told(error: BaseException) -> str:
    r"""
    Return an error in one line: what and where.

    >>> told(ValueError('no\nway'))
    'ValueError: no way'
    """
    text = f'{type(error).__name__}: {" ".join(str(error).split())}'
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    if trace is None:
        return text
    return f'{text} ({Path(trace.tb_frame.f_code.co_filename).name}, line {trace.tb_lineno})'


def digest_of(file: Path) -> str:
    """
    Return a short hash of a file's content.

    :raises ValueError: where it cannot be read.
    """
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()[:12]
    except OSError as error:
        raise ValueError(f'{file} cannot be read: {error.strerror}') from error
