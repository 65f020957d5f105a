# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every valve in files, bags and folders is found, whatever its signals are called."""

import numpy as np
import pytest
from damadics_fd.bag import BagError, BagWriter, write_columns
from damadics_fd.bag.errors import NoMeasurementError
from damadics_fd.bag.mapping import parse_maps
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.bag.recording import Recording, find_recordings

from .bag_support import as_csv, needs_messages, simulated, stroke

pytestmark = [needs_messages, pytest.mark.plain]
FLOAT, ARRAY = 'std_msgs/msg/Float64', 'std_msgs/msg/Float64MultiArray'
SECOND = 10**9


def number(value: float) -> bytes:
    return b'\0\1\0\0' + np.float64(value).tobytes()


def quiet(text: str) -> None:
    raise AssertionError(text)


def signals(path, times=range(1, 6)):
    """Write a command and a position as topics of numbers, the position twice as often."""
    with BagWriter(path) as bag:
        cv, x1 = bag.add_topic('/sp', FLOAT), bag.add_topic('/pos', FLOAT)
        for n, at in enumerate(times):
            bag.write(x1, number(10.0 * n), at * SECOND - 1, at * SECOND - 1)
            bag.write(cv, number(50.0 + n), at * SECOND, at * SECOND)
            bag.write(x1, number(10.0 * n + 5.0), at * SECOND + 1, at * SECOND + 1)
    return path


def test_a_folder_holds_bags_tables_and_folders(tmp_path):
    write_columns(tmp_path / 'a.mcap', simulated(20))
    write_columns(tmp_path / 'split', simulated(20))
    as_csv(stroke(30), tmp_path / 'b.csv')
    found = find_recordings([tmp_path])
    names = sorted(recording.path.name for recording in found)
    assert names == ['a.mcap', 'b.csv', 'split']
    for recording in found:
        assert recording.name == str(recording.path)
        [columns] = recording.chunks(quiet)
        assert {'stamp', 'cv', 'x1'} <= columns.keys()
    truth = Recording(tmp_path / 'a.mcap').truth(quiet)
    assert truth['fault'].tolist() == simulated(20)['fault'].tolist()
    assert Recording(tmp_path / 'a.mcap', '/other/measurement').truth(quiet) is None
    assert found[0].truth(quiet) is None, 'a table does not tell'


def test_signals_of_several_topics_are_held_between_their_messages(tmp_path):
    path = signals(tmp_path / 'a.mcap')
    maps = parse_maps(['cv=/sp.data*0.01', 'x1=/pos.data[%]'])
    [recording] = find_recordings([path], maps=maps)
    [columns] = recording.chunks(quiet)
    assert recording.name == str(path)
    expected = [n / 20 for n in range(1, 10)]  # from the first command on
    assert columns['x1'].tolist() == pytest.approx(expected)
    expected = [0.5, 0.5, 0.51, 0.51, 0.52, 0.52, 0.53, 0.53, 0.54]
    assert columns['cv'].tolist() == pytest.approx(expected)
    assert recording.truth(quiet) is None


@pytest.mark.parametrize(
    ('maps', 'said'),
    [
        (['cv=/sp.data'], 'must name at least cv and x1'),
        (['cv=sp', 'x1=/pos.data'], 'write /topic.field'),
        (['cv=/sp.data', 'x1=/no.data'], 'no topic /no'),
        (['cv=/late.data', 'x1=/pos.data'], 'no message of /late comes before the last'),
        (['cv=/many.data', 'x1=/pos.data'], 'an array of 3; write /many.data'),
    ],
)
def test_maps_that_cannot_be_are_told(maps, said, tmp_path):
    path = tmp_path / 'a.mcap'
    with BagWriter(path) as bag:
        topics = {name: bag.add_topic(name, FLOAT) for name in ('/sp', '/pos', '/late')}
        many = bag.add_topic('/many', ARRAY)
        three = b'\0\1\0\0' + bytes(8) + b'\3\0\0\0' + bytes(4) + bytes(24)
        for at in range(3):
            bag.write(topics['/sp'], number(at), at, at)
            bag.write(topics['/pos'], number(at), at, at)
            bag.write(many, three, at, at)
        bag.write(topics['/late'], number(0.0), 9, 9)
    with pytest.raises(BagError, match=said):
        list(Recording(path, maps=parse_maps(maps)).chunks(quiet))


def test_topics_that_were_all_logged_at_once_have_no_clock_in_common(tmp_path):
    with BagWriter(tmp_path / 'b.mcap') as bag:
        topics = [bag.add_topic(name, FLOAT) for name in ('/sp', '/pos')]
        for n in range(4):
            for topic in topics:
                bag.write(topic, number(n), SECOND, SECOND)
    maps = parse_maps(['cv=/sp.data', 'x1=/pos.data'])
    with pytest.raises(BagError, match='no clock in common'):
        list(Recording(tmp_path / 'b.mcap', maps=maps).chunks(quiet))


def test_valves_of_a_bag_are_found_by_their_topics_and_empty_ones_told(tmp_path):
    path = tmp_path / 'two.mcap'
    with path.open('wb') as stream:
        writer = McapWriter(stream)
        kind = writer.add_schema('a/msg/B', 'ros2msg', b'float64 cv')
        one, _ = (writer.add_channel(kind, f'/lv{n}/measurement', 'cdr', {}) for n in (1, 2))
        writer.add_message(one, number(0.5), 1, 1)
        writer.finish()
    told = []
    found = find_recordings([path], on_problem=told.append)
    assert [recording.name for recording in found] == [f'{path}#/lv1/measurement']
    assert isinstance(told[0], NoMeasurementError)
    assert 'the topic /lv2/measurement is empty' in str(told[0])
    assert find_recordings([path], topic='/lv2/measurement')[0].topic == '/lv2/measurement'


def test_what_holds_no_measurement_is_told_with_what_it_holds(tmp_path):
    path = signals(tmp_path / 'a.mcap')
    with pytest.raises(NoMeasurementError, match='has no measurement; it has /pos and /sp|/pos'):
        find_recordings([path])
    with pytest.raises(BagError, match='does not exist'):
        find_recordings([tmp_path / 'nothing.mcap'])
    (tmp_path / 'empty').mkdir()
    with pytest.raises(BagError):
        find_recordings([tmp_path / 'empty'])
    (tmp_path / 'zero.mcap').touch()
    told = []
    assert find_recordings([tmp_path / 'zero.mcap'], on_problem=told.append) == []
    assert told
    with pytest.raises(BagError, match='has no field cv or x1; it has .*Name the'):
        list(Recording(path, '/sp').chunks(quiet))
