# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Serialised blocks are read as the middleware reads them, and cut ones are refused."""

import array

import numpy as np
import pytest
from damadics_fd.core.sample import SIGNALS

pytest.importorskip('damadics_msgs.msg')
from damadics_fd.nodes.fleet.raw_block import BlockReader, block_of, read_block
from damadics_msgs.msg import MeasurementBlock
from rclpy.serialization import deserialize_message, serialize_message


def some_block(rng, sender):
    """Make a block with columns of any lengths."""
    message = MeasurementBlock(layout=int(rng.integers(2**32)))
    message.header.frame_id = sender
    sizes = rng.choice([0, 0, 1, 2, 7], 2 + len(SIGNALS))
    message.valve = array.array('I', rng.integers(0, 2**32, sizes[0], np.uint32).tobytes())
    message.stamp = array.array('q', rng.integers(-(2**63), 2**63 - 1, sizes[1]).tobytes())
    for name, size in zip(SIGNALS, sizes[2:], strict=True):
        setattr(message, name, array.array('d', rng.normal(size=size).tobytes()))
    return message


def told(block):
    columns = {name: column.tolist() for name, column in block.signals.items()}
    return block.sender, block.layout, block.valve.tolist(), block.stamp.tolist(), columns


@pytest.mark.parametrize('sender', ['', 'a', 'gateway', 'Stellwerk \u00e4', 'x' * 61])
def test_blocks_are_read_as_the_middleware_reads_them(sender):
    rng = np.random.default_rng(len(sender))
    for _ in range(50):
        data = serialize_message(some_block(rng, sender))
        found = read_block(data)
        assert told(found) == told(block_of(deserialize_message(data, MeasurementBlock)))
        for column in (found.valve, found.stamp, *found.signals.values()):
            assert column.flags.aligned and column.flags.c_contiguous


def test_what_is_no_block_is_refused_and_never_read_beyond_its_end():
    rng = np.random.default_rng(7)
    message = some_block(rng, 'gateway')
    message.ps = array.array('d', [1.0, 2.0])
    data = serialize_message(message)
    end = len(data) - len(data) % 4 - 40  # behind the last column there may be filling
    for size in range(0, end, 3):
        with pytest.raises(ValueError):
            read_block(data[:size])
    for _ in range(300):
        noise = bytearray(data)
        for at in rng.integers(2, len(data), 4):
            noise[at] = rng.integers(256)
        try:
            found = read_block(bytes(noise))
        except ValueError:
            continue
        assert sum(map(len, found.signals.values())) * 8 <= len(noise)


def same_form(rng, message):
    """Give a block other stamps and signals, as the next one of its sender has."""
    message.header.stamp.sec += 1
    message.stamp = array.array('q', rng.integers(0, 2**60, len(message.stamp)).tobytes())
    for name in SIGNALS:
        size = len(getattr(message, name))
        setattr(message, name, array.array('d', rng.normal(size=size).tobytes()))


def test_a_reader_of_blocks_reads_each_alike_whatever_came_before():
    rng, read = np.random.default_rng(3), BlockReader()
    quick = 0
    for sender in ('a', 'gateway', 'a', 'b'):
        message = some_block(rng, sender)
        for _ in range(5):
            same_form(rng, message)
            data = serialize_message(message)
            before = getattr(read, '_block', None)
            found = read(data)
            quick += found is before
            assert told(found) == told(read_block(data))
            assert all(column.flags.aligned for column in found.signals.values())
    assert quick == 4 * 3  # the first of a form is read as any, the second is kept


def test_a_block_of_the_same_size_and_another_form_is_read_as_it_is():
    rng, read = np.random.default_rng(5), BlockReader()
    message = some_block(rng, 'gateway')
    for name, size in zip(SIGNALS, (2, 3, 0, 1, 2, 3, 2), strict=True):
        setattr(message, name, array.array('d', rng.normal(size=size).tobytes()))
    for _ in range(3):
        read(serialize_message(message))
    kept = serialize_message(message)
    message.cv, message.x1 = message.x1, message.cv
    for change in ('columns', 'layout', 'sender'):
        if change == 'layout':
            message.layout ^= 1
        elif change == 'sender':
            message.header.frame_id = 'getaway'
        data = serialize_message(message)
        assert len(data) == len(kept)
        assert told(read(data)) == told(read_block(data))
        assert told(read(kept)) == told(read_block(kept))
    for _ in range(500):  # whatever is wrong is wrong for both
        noise = bytearray(kept)
        for at in rng.integers(0, len(kept), 3):
            noise[at] = rng.integers(256)
        try:
            expected = told(read_block(bytes(noise)))
        except ValueError:
            with pytest.raises(ValueError):
                read(bytes(noise))
        else:
            np.testing.assert_equal(told(read(bytes(noise))), expected)
        read(kept)
        assert told(read(kept)) == told(read_block(kept))
