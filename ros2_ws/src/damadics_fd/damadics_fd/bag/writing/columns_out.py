# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write columns as the recorder would have written their messages."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from damadics_fd.bag.arrays import Column
from damadics_fd.bag.mapping import SIGNALS
from damadics_fd.bag.rosbag2 import qos
from damadics_fd.bag.writing.bag_writer import BagWriter


def write_columns(
    path: str | Path,
    columns: Mapping[str, Column],
    frame_id: str = 'LC74_20',
) -> None:
    """
    Write simulated or converted columns as the recorder would have written them.

    :param path: `.mcap` file or bag directory.
    :param columns: `stamp` [ns] and fields of `damadics_msgs/Measurement`, NaN if absent; with
        `fault` and `strength` also the topic `/fault_state`.
    :param frame_id: tag of the actuator.
    :raises BagError: where the file cannot be written or the messages are not built.
    """
    stamp = np.asarray(columns['stamp'], np.int64)
    missing = np.full(len(stamp), np.nan)
    messages = {'/measurement': {name: columns.get(name, missing) for name in SIGNALS}}
    kinds = {'/measurement': 'damadics_msgs/msg/Measurement'}
    if 'fault' in columns:
        messages['/fault_state'] = {name: columns[name] for name in ('strength', 'fault')}
        kinds['/fault_state'] = 'damadics_msgs/msg/FaultState'
    with BagWriter(path) as bag:
        for name, kind in kinds.items():
            bag.add_topic(name, kind, [qos(depth=1000)])
        bag.write_columns(stamp, messages, frame_id)
