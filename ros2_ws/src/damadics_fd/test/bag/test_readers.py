# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Independent readers agree with ours, and bags of independent writers are replayed."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.bag import read_columns, write_columns
from damadics_fd.bag.cdr.definition import schema_text, type_hash
from damadics_fd.bag.inspection import WHOLE, inspect
from damadics_fd.commands.replay.replay import main

from .bag_support import MEASUREMENT, SIGNALS, needs_messages, simulated, stroke

pytestmark = needs_messages

PACKAGES = ('@mcap/core@2.2.2', 'fzstd@0.1.1')
NODE_SCRIPT = """
const { McapIndexedReader, McapStreamReader } = require('@mcap/core');
const zstd = require('fzstd');
const { open } = require('fs/promises');
(async () => {
  const path = process.argv[2];
  const file = await open(path, 'r');
  const decompressHandlers = { zstd: (data, size) => zstd.decompress(data, new Uint8Array(Number(size))) };
  const readable = {
    size: async () => BigInt((await file.stat()).size),
    read: async (offset, length) => {
      const buffer = new Uint8Array(Number(length));
      await file.read(buffer, 0, Number(length), Number(offset));
      return buffer;
    },
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const values = [], stamps = [];
  for await (const message of reader.readMessages({ topics: ['/measurement'] })) {
    const view = new DataView(message.data.buffer, message.data.byteOffset, message.data.byteLength);
    values.push(view.getFloat64(36, true));
    stamps.push(String(message.logTime));
  }
  const metadata = [];
  for await (const record of reader.readMetadata()) metadata.push(record.name);
  const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  stream.append(new Uint8Array(await file.readFile()));
  let streamed = 0;
  for (let r; (r = stream.nextRecord()); ) streamed += r.type === 'Message' ? 1 : 0;
  console.log(JSON.stringify({
    profile: reader.header.profile, values, stamps, metadata, streamed,
    channels: [...reader.channelsById.values()].map((c) => ({
      topic: c.topic, encoding: c.messageEncoding, metadata: Object.fromEntries(c.metadata),
      schema: reader.schemasById.get(c.schemaId).name,
    })),
    count: String(reader.statistics.messageCount),
  }));
})();
"""  # noqa: E501


@pytest.fixture
def node(tmp_path):
    """Return a function that runs a script with the packages, which npm fetches if need be."""
    program, npm = shutil.which('node'), shutil.which('npm')
    if not program:
        pytest.skip('node is not installed')
    env = dict(os.environ)
    probe = [program, '-e', "require('@mcap/core'); require('fzstd')"]
    if subprocess.run(probe, env=env, capture_output=True).returncode:
        if not npm:
            pytest.skip('npm is not installed, nor are @mcap/core and fzstd in NODE_PATH')
        install = [npm, 'install', '--prefix', str(tmp_path), '--no-audit', '--no-fund', *PACKAGES]
        try:
            done = subprocess.run(install, capture_output=True, text=True, timeout=60)
        except subprocess.TimeoutExpired:
            pytest.skip('the npm registry does not answer')
        if done.returncode:
            pytest.skip(f'npm install {" ".join(PACKAGES)}: {done.stderr.strip()[-200:]}')
        env['NODE_PATH'] = str(tmp_path / 'node_modules')

    def run(*arguments):
        return subprocess.run(
            [program, *map(str, arguments)],
            env=env,
            check=True,
            capture_output=True,
            text=True,
            timeout=100,
        ).stdout

    return run


def test_the_reference_reader_of_mcap_in_typescript_agrees(tmp_path, node):
    columns = simulated(20_000)
    write_columns(tmp_path / 'a.mcap', columns, frame_id='LC74_20')
    (tmp_path / 'read.js').write_text(NODE_SCRIPT)
    found = json.loads(node(tmp_path / 'read.js', tmp_path / 'a.mcap'))
    assert found['profile'] == 'ros2'
    assert found['values'] == columns['x1'].tolist()
    assert [int(stamp) for stamp in found['stamps']] == columns['stamp'].tolist()
    assert (found['count'], found['streamed']) == ('40000', 40000)
    assert found['metadata'] == ['rosbag2']
    channel = next(c for c in found['channels'] if c['topic'] == '/measurement')
    assert (channel['encoding'], channel['schema']) == ('cdr', MEASUREMENT)
    assert channel['metadata']['topic_type_hash'] == type_hash(MEASUREMENT)
    assert 'reliability: reliable' in channel['metadata']['offered_qos_profiles']


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
