# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bags of independent writers are read and replayed."""

import json
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.bag import read_columns, write_columns
from damadics_fd.bag.cdr.definition import schema_text
from damadics_fd.bag.checking.inspection import WHOLE, inspect
from damadics_fd.commands.replay.replay import main

from .bag_support import MEASUREMENT, SIGNALS, needs_messages, stroke

pytestmark = needs_messages


def detections(path: Path, tmp_path: Path) -> list:
    out = tmp_path / 'result.json'
    assert main([str(path), '--mode', 'paper', '--out', str(out)]) == 0
    (result,) = json.loads(out.read_text())
    assert result['samples'] == 12_000
    return [(d['t'], d['residual']) for d in result['detections']]


def test_bags_of_rosbags_and_mcap_ros2_support_are_replayed(tmp_path):
    typesys = pytest.importorskip('rosbags.typesys')
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    mcap_ros2 = pytest.importorskip('mcap_ros2.writer')
    columns = stroke()
    write_columns(tmp_path / 'own.mcap', columns)
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    definition = schema_text(MEASUREMENT)
    store.register(typesys.get_types_from_msg(definition.split('=' * 80)[0], MEASUREMENT))
    types = store.types
    rows = list(
        zip(
            columns['stamp'].tolist(),
            *(columns[n].tolist() for n in (*SIGNALS, 'ps')),
            strict=True,
        )
    )

    with rosbag2.Writer(
        tmp_path / 'rosbags', version=9, storage_plugin=rosbag2.StoragePlugin.MCAP
    ) as writer:
        connection = writer.add_connection('/measurement', MEASUREMENT, typestore=store)
        for stamp, *values in rows:
            time = types['builtin_interfaces/msg/Time'](stamp // 10**9, stamp % 10**9)
            header = types['std_msgs/msg/Header'](time, 'LC74_20')
            message = types[MEASUREMENT](header, *values)
            writer.write(connection, stamp, store.serialize_cdr(message, MEASUREMENT))

    with (tmp_path / 'mcap_ros2.mcap').open('wb') as stream:
        writer = mcap_ros2.Writer(stream)
        schema = writer.register_msgdef(MEASUREMENT, definition)
        for stamp, *values in rows:
            header = {'stamp': {'sec': stamp // 10**9, 'nanosec': stamp % 10**9}, 'frame_id': 'V'}
            message = {'header': header} | dict(zip((*SIGNALS, 'ps'), values, strict=True))
            writer.write_message('/measurement', schema, message, stamp, stamp)
        writer.finish()

    own = detections(tmp_path / 'own.mcap', tmp_path)
    assert own
    assert detections(tmp_path / 'rosbags', tmp_path) == own
    assert detections(tmp_path / 'mcap_ros2.mcap', tmp_path) == own
    assert inspect(tmp_path / 'rosbags').code == WHOLE
    assert inspect(tmp_path / 'mcap_ros2.mcap').code == WHOLE


@pytest.mark.plain
@pytest.mark.parametrize('compression', ['NONE', 'LZ4', 'ZSTD'])
@pytest.mark.parametrize('chunked', [True, False])
def test_files_of_the_python_mcap_writer_are_read_in_any_form(tmp_path, compression, chunked):
    mcap = pytest.importorskip('mcap.writer')
    if compression == 'LZ4':
        pytest.importorskip('lz4')
    with (tmp_path / 'a.mcap').open('wb') as stream:
        writer = mcap.Writer(
            stream,
            chunk_size=1000,
            use_chunking=chunked,
            compression=mcap.CompressionType[compression],
        )
        writer.start('ros2')
        schema = writer.register_schema('std_msgs/msg/Float64', 'ros2msg', b'float64 data')
        channel = writer.register_channel('/a', 'cdr', schema)
        for i in range(500):
            data = b'\0\1\0\0' + np.float64(i).tobytes()
            writer.add_message(channel, i, data, i)
        writer.finish()
    assert read_columns(tmp_path / 'a.mcap', '/a')['data'].tolist() == list(range(500))
    report = inspect(tmp_path / 'a.mcap')
    assert (report.code, report.messages) == (WHOLE, 500)
