# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write runs to files, block by block."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from damadics_fd.core.sample import SIGNALS

CSV_COLUMNS = ('t', *SIGNALS, 'fault', 'strength')

BYTES_PER_SAMPLE = 150
"""About the size of a sample in either kind of file."""

Write = Callable[[Mapping[str, np.ndarray]], None]


@contextmanager
def open_writer(path: Path) -> Iterator[Write]:
    """
    Open a file for a run; it is whole whenever the context ends, also by Ctrl-C.

    :param path: `FILE.csv`, or `FILE.mcap` as the recorder would have written it.
    :return: a function that takes the next block of columns.
    :raises ValueError: if the extension is neither, or the file cannot hold the run.
    :raises OSError: if the file cannot be written.
    """
    if path.suffix == '.csv':
        with path.open('w', encoding='ascii', newline='') as file:
            file.write(','.join(CSV_COLUMNS) + '\n')

            def write(columns: Mapping[str, np.ndarray]) -> None:
                lists = [(columns['stamp'] / 1e9).tolist()]
                lists += [columns[name].tolist() for name in CSV_COLUMNS[1:]]
                file.writelines(
                    ','.join(map(repr, row)) + '\n' for row in zip(*lists, strict=True)
                )

            yield write
    elif path.suffix == '.mcap':
        yield from _mcap(path)
    else:
        raise ValueError(f'--out: {path} is neither FILE.csv nor FILE.mcap')


def _mcap(path: Path) -> Iterator[Write]:
    from damadics_fd.bag.cdr.definition import schema_text
    from damadics_fd.bag.rosbag2 import qos
    from damadics_fd.bag.writing.bag_writer import BagWriter

    schema_text('damadics_msgs/msg/Measurement')  # refused before there is a file
    with BagWriter(path) as bag:
        bag.add_topic('/measurement', 'damadics_msgs/msg/Measurement', [qos(depth=1000)])
        bag.add_topic('/fault_state', 'damadics_msgs/msg/FaultState', [qos(depth=1000)])

        def write(columns: Mapping[str, np.ndarray]) -> None:
            bag.write_columns(
                columns['stamp'],
                {
                    '/measurement': {name: columns[name] for name in SIGNALS},
                    '/fault_state': {name: columns[name] for name in ('strength', 'fault')},
                },
                'LC74_20',
            )

        yield write
