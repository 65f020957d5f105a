# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""An SQLite file that is an auxiliary: where it is damaged, it is moved aside and begun anew."""

import sqlite3
import time
from collections.abc import Collection, Mapping, Sequence
from itertools import count
from pathlib import Path

PATIENCE = 0.2  # s that another process may hold the file
SMALL = 50_000_000  # bytes; a file of this size is checked in a moment
DAMAGED = (sqlite3.DatabaseError, UnicodeDecodeError)  # messages of SQLite quote what is damaged
Tables = Mapping[str, Mapping[str, str]]  # type of each column by table


def open_database(
    path: Path, tables: Tables, more: Sequence[str] = (), later: Collection[str] = ()
) -> tuple[sqlite3.Connection, str]:
    """
    Open a database, and make what is not in it yet.

    :param path: the file; it is made where it is missing.
    :param tables: their columns.
    :param more: further statements, such as those of indexes.
    :param later: columns that files of earlier versions do not have: they get them, empty.
    :return: the connection, and what happened to a damaged file ('' where there was none).
    :raises OSError: where the folder cannot be written or another process holds the file.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        return _opened(path, tables, more, later), ''
    except DAMAGED as problem:
        if 'locked' in str(problem) or not path.exists():
            raise OSError(f'{path}: {problem}') from problem
        aside = _aside(path)
        path.rename(aside)
        for suffix in ('-wal', '-shm'):
            path.with_name(path.name + suffix).unlink(missing_ok=True)
        try:
            return _opened(path, tables, more, later), f'{problem}; the file of before is {aside}'
        except DAMAGED as again:
            raise OSError(f'{path}: {again}') from again


def _aside(path: Path) -> Path:
    """Return a name for a damaged file, which is no other's."""
    name = time.strftime(f'{path.name}.bad-%Y%m%dT%H%M%S')
    names = (f'{name}-{number}' if number else name for number in count())
    return next(path.with_name(one) for one in names if not path.with_name(one).exists())


def _text(data: bytes) -> str:
    """Read a text, of which a byte may be damaged."""
    return data.decode(errors='replace')


def _opened(
    path: Path, tables: Tables, more: Sequence[str], later: Collection[str]
) -> sqlite3.Connection:
    database = sqlite3.connect(path, timeout=PATIENCE, check_same_thread=False)
    database.text_factory = _text
    try:
        database.execute('PRAGMA journal_mode=WAL')
        database.execute('PRAGMA synchronous=NORMAL')
        for table, columns in tables.items():
            described = ', '.join(f'{name} {kind}' for name, kind in columns.items())
            database.execute(f'CREATE TABLE IF NOT EXISTS {table} ({described})')
            there = {row[1] for row in database.execute(f'PRAGMA table_info({table})')}
            missing = set(columns) - there
            if missing and missing <= set(later):
                for name in missing:
                    database.execute(f'ALTER TABLE {table} ADD COLUMN {name} {columns[name]}')
            elif missing:
                raise sqlite3.DatabaseError(f'its table {table} has other columns')
        for statement in more:
            database.execute(statement)
        database.commit()
        if path.stat().st_size < SMALL:
            (state,) = database.execute('PRAGMA quick_check(1)').fetchone()
            if state != 'ok':
                raise sqlite3.DatabaseError(state)
    except DAMAGED:
        database.close()
        raise
    return database
