# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Bags that this project writes, read by independent readers."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from damadics_fd.bag import BagError, BagWriter, write_columns
from damadics_fd.bag.cdr.definition import parse_definition, schema_text, type_hash
from damadics_fd.bag.cdr.layout import layout_of
from damadics_fd.bag.rosbag2 import qos

from .bag_support import FAULT_STATE, MEASUREMENT, needs_messages, simulated

pytestmark = [needs_messages, pytest.mark.plain]


def decoded(path: Path, topic: str) -> list:
    mcap = pytest.importorskip('mcap.reader')
    factory = pytest.importorskip('mcap_ros2.decoder').DecoderFactory()
    with path.open('rb') as stream:
        reader = mcap.make_reader(stream, validate_crcs=True, decoder_factories=[factory])
        return [(m.log_time, ros) for _, _, m, ros in reader.iter_decoded_messages([topic])]


def test_columns_written_are_read_by_mcap_ros2_with_equal_values(tmp_path):
    columns = simulated()
    write_columns(tmp_path / 'a.mcap', columns, frame_id='V1')
    messages = decoded(tmp_path / 'a.mcap', '/measurement')
    assert [log_time for log_time, _ in messages] == columns['stamp'].tolist()
    for name in ('cv', 'x1', 'p1', 'p2', 't1', 'flow'):
        assert [getattr(ros, name) for _, ros in messages] == columns[name].tolist()
    assert all(np.isnan(ros.ps) for _, ros in messages)
    assert {ros.header.frame_id for _, ros in messages} == {'V1'}
    stamps = [ros.header.stamp.sec * 10**9 + ros.header.stamp.nanosec for _, ros in messages]
    assert stamps == columns['stamp'].tolist()
    states = [ros for _, ros in decoded(tmp_path / 'a.mcap', '/fault_state')]
    assert [ros.fault for ros in states] == columns['fault'].tolist()
    assert [ros.strength for ros in states] == columns['strength'].tolist()


def test_topics_alternate_in_the_file_as_they_were_published(tmp_path):
    write_columns(tmp_path / 'a.mcap', simulated(50))
    mcap = pytest.importorskip('mcap.reader')
    with (tmp_path / 'a.mcap').open('rb') as stream:
        reader = mcap.make_reader(stream)
        order = [c.topic for _, c, _ in reader.iter_messages(log_time_order=False)]
    assert order == ['/measurement', '/fault_state'] * 50


def test_a_bag_directory_is_complete_for_rosbag2(tmp_path):
    columns = simulated()
    write_columns(tmp_path / 'bag', columns)
    text = (tmp_path / 'bag' / 'metadata.yaml').read_text()
    information = yaml.safe_load(text)['rosbag2_bagfile_information']
    assert information['version'] == 9
    assert information['storage_identifier'] == 'mcap'
    assert information['message_count'] == 8000
    assert information['starting_time']['nanoseconds_since_epoch'] == columns['stamp'][0]
    assert information['duration']['nanoseconds'] == columns['stamp'][-1] - columns['stamp'][0]
    assert information['relative_file_paths'] == ['bag_0.mcap']
    topics = [t['topic_metadata'] for t in information['topics_with_message_count']]
    assert [t['type'] for t in topics] == [MEASUREMENT, FAULT_STATE]
    assert topics[0]['offered_qos_profiles'][0]['reliability'] == 'reliable'
    assert '&' not in text  # no YAML anchors


def test_channels_carry_what_the_ros2_profile_requires(tmp_path):
    write_columns(tmp_path / 'a.mcap', simulated(10))
    mcap = pytest.importorskip('mcap.reader')
    with (tmp_path / 'a.mcap').open('rb') as stream:
        reader = mcap.make_reader(stream)
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
        records = list(reader.iter_metadata())
    channel = next(c for c in summary.channels.values() if c.topic == '/measurement')
    schema = summary.schemas[channel.schema_id]
    assert (schema.name, schema.encoding) == (MEASUREMENT, 'ros2msg')
    assert b'stem position / stroke' in schema.data  # comments travel with the data
    assert yaml.safe_load(channel.metadata['offered_qos_profiles'])[0]['depth'] == 1000
    assert channel.metadata['topic_type_hash'] == type_hash(MEASUREMENT)
    assert [record.name for record in records] == ['rosbag2']
    assert yaml.safe_load(records[0].metadata['serialized_metadata'])['message_count'] == 20


def test_rosbags_reads_the_bag_and_computes_the_same_type_hash(tmp_path):
    highlevel = pytest.importorskip('rosbags.highlevel')
    typesys = pytest.importorskip('rosbags.typesys')
    columns = simulated(500)
    write_columns(tmp_path / 'bag', columns)
    with highlevel.AnyReader([tmp_path / 'bag']) as reader:
        connection = next(c for c in reader.connections if c.topic == '/measurement')
        values = [
            reader.deserialize(raw, connection.msgtype).x1
            for _, _, raw in reader.messages([connection])
        ]
    assert values == columns['x1'].tolist()
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for kind in (MEASUREMENT, FAULT_STATE):
        store.register(typesys.get_types_from_msg(schema_text(kind).split('=' * 80)[0], kind))
        assert store.hash_rihs01(kind) == type_hash(kind)


def test_split_bags_hold_every_message_once(tmp_path):
    with BagWriter(tmp_path / 'bag', split_seconds=1.0) as bag:
        topic = bag.add_topic('/a', 'std_msgs/msg/Float64', [qos()])
        for i in range(35):
            bag.write(topic, b'\0\1\0\0' + np.float64(i).tobytes(), i * 10**8, i * 10**8)
    files = sorted((tmp_path / 'bag').glob('*.mcap'))
    assert [len(decoded(file, '/a')) for file in files] == [10, 10, 10, 5]
    rosbag2 = yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())
    information = rosbag2['rosbag2_bagfile_information']
    assert [file['message_count'] for file in information['files']] == [10, 10, 10, 5]


def test_an_existing_bag_is_not_overwritten(tmp_path):
    write_columns(tmp_path / 'bag', simulated(2))
    with pytest.raises(BagError, match='not empty'):
        BagWriter(tmp_path / 'bag')


def test_a_type_that_is_not_installed_is_refused(tmp_path):
    with (
        BagWriter(tmp_path / 'bag') as bag,
        pytest.raises(BagError, match='no installed definition of no_msgs/msg/Such'),
    ):
        bag.add_topic('/a', 'no_msgs/msg/Such')


def test_layouts_follow_the_alignment_of_cdr():
    definition = parse_definition('a/msg/B', 'uint8 a\nfloat64 b\nstring c\nint16[3] d\nbool[] e')
    data = (
        b'\0\1\0\0'
        + b'\7'
        + bytes(7)
        + np.float64(2.5).tobytes()
        + b'\3\0\0\0'
        + b'hi\0'
        + bytes(1)
        + np.int16([1, 2, 3]).tobytes()
        + bytes(2)
        + b'\2\0\0\0'
        + b'\1\0'
    )
    layout = layout_of(definition, 'a/msg/B', data)
    message = np.frombuffer(data, layout.dtype())[0]
    assert layout.size == len(data)
    assert (message['a'], message['b'], message['c']) == (7, 2.5, b'hi')
    assert message['d'].tolist() == [1, 2, 3]
    assert message['e'].tolist() == [1, 0]
