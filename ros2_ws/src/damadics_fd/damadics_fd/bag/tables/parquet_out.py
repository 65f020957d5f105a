# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Blocks of many valves as Parquet: one row per sample, with a column that names the valve."""

from pathlib import Path

import numpy as np

from damadics_fd.bag.blocks.layouts import Told
from damadics_fd.bag.blocks.reader import BlockReader
from damadics_fd.bag.errors import BagError
from damadics_fd.core.sample import SIGNALS

GROUP = 1 << 17  # rows that are written at once


def write_parquet(
    path: str | Path,
    out: str | Path,
    topic: str = '/measurement_block',
    on_problem: Told | None = None,
) -> int:
    """
    Write the blocks of a bag as one Parquet file, which `replay` takes as it takes the bag.

    :param path: MCAP file, bag directory, SQLite bag.
    :param out: file to write; one that is there is not overwritten.
    :param topic: of the blocks.
    :param on_problem: told what is damaged or odd, which is left out; None makes it an error.
    :return: number of rows: `valve` (text), `stamp` (int64, ns), the seven signals (NaN: not
        measured), in the order of the bag.
    :raises BagError: where the bag cannot be read, the file is there, or pyarrow is missing.
    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise BagError('Parquet needs pyarrow: pip install pyarrow', out) from error
    reader = BlockReader(path, topic, on_problem)
    names = pyarrow.array(reader.names, pyarrow.string())
    schema = pyarrow.schema(
        [
            ('valve', pyarrow.dictionary(pyarrow.int32(), pyarrow.string())),
            ('stamp', pyarrow.int64()),
            *((name, pyarrow.float64()) for name in SIGNALS),
        ]
    )
    count = 0
    try:
        with Path(out).open('xb') as file, parquet.ParquetWriter(file, schema) as writer:
            waiting: list[pyarrow.Table] = []
            for rows in reader.rows():
                valve = pyarrow.array(rows['valve'].astype(np.int32))
                columns = [pyarrow.DictionaryArray.from_arrays(valve, names)]
                columns += [pyarrow.array(rows[name]) for name in ('stamp', *SIGNALS)]
                waiting.append(pyarrow.table(columns, schema=schema))
                count += len(rows['stamp'])
                if sum(map(len, waiting)) >= GROUP:
                    writer.write_table(pyarrow.concat_tables(waiting))
                    waiting = []
            if waiting:
                writer.write_table(pyarrow.concat_tables(waiting))
    except OSError as error:
        raise BagError(f'cannot write: {error.strerror}', out) from error
    return count
