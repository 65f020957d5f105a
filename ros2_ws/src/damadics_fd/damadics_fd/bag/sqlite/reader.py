# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read SQLite bags, the default of rosbag2 up to Humble, compressed or not."""

import shutil
import sqlite3
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from damadics_fd.bag.cdr.definition import schema_text
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.limits import Limits
from damadics_fd.bag.mcap.records import Channel, Schema
from damadics_fd.bag.mcap.unpack import ZSTD_MAGIC, unpacked
from damadics_fd.bag.messages import MessageFile
from damadics_fd.bag.sqlite.rows import Rows

MAGIC = b'SQLite format 3\0'
BLOCK = 1 << 20  # [B] copied at a time
STEPS = 1_000_000  # of the database between two looks at the budget
STEPS_PER_BYTE = 200  # of the file, that any query may take
BESIDE = ('-wal', '-journal')  # what a writer that did not end leaves beside the file


class SqliteFile(MessageFile):
    """
    Read one SQLite file of rosbag2; it and what lies beside it are left as they are.

    :param path: file, possibly compressed as a whole (`.zstd`).
    :param tolerant: read on behind damage and collect it in `problems`; otherwise it is an error.
    :param limits: what the file may ask for.
    :raises BagError: where the file cannot be opened or is no bag.
    """

    unit = 'message'

    def __init__(self, path: str | Path, tolerant: bool = False, limits: Limits = Limits()):
        super().__init__(path, tolerant, limits)
        self.profile = 'ros2'
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._numbers: dict[int, int] = {}  # channels by the id of the topic
        self._counts: dict[int, int] | None = None
        self._steps = 0
        try:
            self._database = self._open()
            self._read_topics()
        except (sqlite3.Error, OverflowError, OSError) as error:
            self.close()
            raise BagError(f'is a damaged SQLite bag: {error}', self.path) from error
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the file."""
        database = getattr(self, '_database', None)
        if database:
            database.close()
        if self._folder:
            self._folder.cleanup()
            self._folder = None

    def _open(self) -> sqlite3.Connection:
        source = self._readable_file()
        if self._folder:
            uri = f'{source.as_uri()}?mode=rw'  # our copy, into which the log may be merged
        else:
            uri = f'{source.resolve().as_uri()}?mode=ro&immutable=1'
        database = sqlite3.connect(uri, uri=True)
        database.text_factory = lambda data: data.decode('utf-8', 'replace')
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, self.limits.chunk)
        database.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
        for pragma in ('trusted_schema=OFF', 'query_only=ON', 'cell_size_check=ON'):
            database.execute(f'PRAGMA {pragma}')
        budget = STEPS_PER_BYTE * source.stat().st_size + 10 * STEPS

        def spend() -> bool:
            self._steps += STEPS
            return self._steps > budget

        database.set_progress_handler(spend, STEPS)
        return database

    def _readable_file(self) -> Path:
        """Return the database itself, or a copy of it with what a writer left beside it."""
        with self.path.open('rb') as stream:
            if stream.read(4) == ZSTD_MAGIC:
                self._folder = tempfile.TemporaryDirectory()
                target = Path(self._folder.name, 'bag.db3')
                with unpacked(stream, self.path, self.limits) as plain, target.open('wb') as copy:
                    shutil.copyfileobj(plain, copy, BLOCK)
                return target
        beside = [self.path.with_name(self.path.name + suffix) for suffix in BESIDE]
        beside = [file for file in beside if file.is_file() and file.stat().st_size]
        if not beside:
            return self.path
        self._folder = tempfile.TemporaryDirectory()
        target = Path(self._folder.name, self.path.name)
        for file in (self.path, *beside):
            shutil.copyfile(file, target.with_name(file.name))
        return target

    def _columns(self, table: str) -> set[str]:
        """Return the columns of a true table, none where it is a view or not there."""
        found = self._database.execute(
            "SELECT rootpage, sql FROM sqlite_master WHERE type = 'table' AND name = ?", (table,)
        ).fetchone()
        if not found or not found[0] or not str(found[1]).lstrip().upper().startswith('CREATE TA'):
            return set()
        return {str(row[1]) for row in self._database.execute(f'PRAGMA table_info({table})')}

    def _read_topics(self) -> None:
        present = self._columns('topics')
        needed = ('id', 'name', 'type', 'serialization_format')
        if not present.issuperset(needed) or not self._columns('messages').issuperset(
            ('topic_id', 'timestamp', 'data')
        ):
            raise BagError('is an SQLite file, but no bag of rosbag2', self.path)
        names = [
            name if name in present else "''"
            for name in (*needed, 'offered_qos_profiles', 'type_description_hash')
        ]
        definitions = self._definitions()
        schemas: dict[str, int] = {}
        rows = self._database.execute(f'SELECT {", ".join(names)} FROM topics ORDER BY id')
        for number, row in enumerate(rows.fetchmany(self.limits.channels), 1):
            topic, kind, encoding, profiles, hash_ = (
                text if isinstance(text, str) else '' for text in row[1:]
            )
            if kind not in schemas:
                schemas[kind] = len(schemas) + 1
                schema = Schema(schemas[kind], kind, *definitions.get(kind, ('', b'')))
                self.schemas[schema.id] = schema if schema.encoding else _installed(schema)
            metadata = {'offered_qos_profiles': profiles}
            if 'type_description_hash' in present:
                metadata['topic_type_hash'] = hash_
            self.channels[number] = Channel(number, schemas[kind], topic, encoding, metadata)
            self._numbers[row[0]] = number
            self.room(sum(map(len, (topic, kind, profiles))))
        if rows.fetchone():
            self.once(f'there are more than {self.limits.channels} topics: the rest is left')

    def _definitions(self) -> dict[str, tuple[str, bytes]]:
        """Return encoding and text of the types, where the bag has them (since Iron)."""
        names = ('topic_type', 'encoding', 'encoded_message_definition')
        if not self._columns('message_definitions').issuperset(names):
            return {}
        found: dict[str, tuple[str, bytes]] = {}
        for row in self._database.execute(f'SELECT {", ".join(names)} FROM message_definitions'):
            kind, encoding, text = (cell if isinstance(cell, str) else '' for cell in row)
            if text and self.room(len(text)):
                found[kind] = encoding, text.encode()
        return found

    @property
    def stated(self) -> Mapping[int, int]:
        """Messages by channel, counted by the database."""
        if self._counts is None:
            query = 'SELECT topic_id, count(*) FROM messages GROUP BY topic_id'
            try:
                rows = self._database.execute(query).fetchmany(self.limits.channels)
            except sqlite3.Error:
                rows = []
            self._counts = {
                self._numbers[topic]: count for topic, count in rows if topic in self._numbers
            }
        return self._counts

    def chunks(self) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """
        Yield the messages as Message records of MCAP, each block with the id of its first.

        :raises BagError: at damage, unless it is tolerated.
        """
        rows = Rows(self._database, self._numbers, self._unpack, self.limits.chunk, self.problem)
        counts: Counter[int] = Counter()
        following: int | None = -(2**63)
        while following is not None and not self._given_up:
            last = following
            try:
                for block in rows.blocks(following):
                    last = block.last
                    counts.update(dict(enumerate(np.bincount(block.channels).tolist())))
                    if len(block.records):
                        yield block.first, block.records
                break
            except sqlite3.Error as error:
                self.problem(last, f'the database is damaged: {error}')
                following = _behind(rows, last)
        if not self.problems and self._counts is None:  # no need to ask for them
            self._counts = {number: count for number, count in counts.items() if count}

    def check(self) -> None:
        """
        Check the structure of the database.

        :raises BagError: where it is damaged, unless that is tolerated.
        """
        try:
            found = self._database.execute('PRAGMA quick_check(1)').fetchone()
        except sqlite3.Error as error:
            found = (str(error),)
        if found and found[0] != 'ok':
            self.problem(0, f'the database is damaged: {found[0]}')


def _behind(rows: Rows, last: int) -> int | None:
    """Return the first id behind a damaged place, None where nothing can be read."""
    low, step = max(last, 0), 1
    while not rows.readable(low + step):
        low, step = low + step, 2 * step
        if step > 1 << 40:
            return None
    high = low + step
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if rows.readable(middle) else (middle, high)
    return high


def _installed(schema: Schema) -> Schema:
    """Take the definition of the installed type, where the bag has none."""
    try:
        return Schema(schema.id, schema.name, 'ros2msg', schema_text(schema.name).encode())
    except (BagError, OSError, ValueError):
        return schema
