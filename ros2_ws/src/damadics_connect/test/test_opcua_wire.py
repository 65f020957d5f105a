"""Data changes read from bytes, against asyncua's own encoder and decoder."""

import math
import struct
from datetime import UTC, datetime, timedelta

import pytest
from asyncua import ua
from asyncua.ua.ua_binary import struct_to_binary
from damadics_connect.opcua.wire import UNIX, WireError, read_changes

T0 = datetime(2026, 3, 29, 0, 59, 59, 999_999, UTC)
T0_NS = 1_774_745_999_999_999_000


def body(*values: ua.DataValue) -> bytes:
    items = [ua.MonitoredItemNotification(n, value) for n, value in enumerate(values)]
    return struct_to_binary(ua.DataChangeNotification(items, []))


def value(x, kind=ua.VariantType.Double, status=0, **times):
    return ua.DataValue(ua.Variant(x, kind), ua.StatusCode(status), **times)


@pytest.mark.parametrize('count', [1, 7, 8, 500])
def test_rows_of_one_layout(count):
    sent = [
        value(0.1 * n, SourceTimestamp=T0 + timedelta(microseconds=n), ServerTimestamp=T0)
        for n in range(count)
    ]
    got = read_changes(body(*sent))
    assert got.handle == list(range(count))
    assert got.value == [0.1 * n for n in range(count)]
    assert got.stamp == [T0_NS + 1000 * n for n in range(count)]
    assert not any(got.status)


def test_rows_of_many_layouts():
    kinds = [
        value(1.5),
        value(7, ua.VariantType.Int32, SourceTimestamp=T0),
        value(True, ua.VariantType.Boolean, ServerTimestamp=T0),
        value('0.5', ua.VariantType.String, SourceTimestamp=T0),
        value([1.0, 2.0], SourceTimestamp=T0),
        value(2.0, status=0x80310000, SourceTimestamp=T0),
        value(3, ua.VariantType.UInt16),
        value(0.25, ua.VariantType.Float, SourceTimestamp=T0),
        ua.DataValue(),
    ]
    got = read_changes(body(*kinds))
    assert got.value[:3] == [1.5, 7.0, 1.0]
    assert got.value[5:8] == [2.0, 3.0, 0.25]
    assert got.kind[:3] == ['', '', ''] and got.kind[3:5] == ['String', 'an array']
    assert math.isnan(got.value[3]) and math.isnan(got.value[4]) and math.isnan(got.value[8])
    assert got.status[5] == 0x80310000
    assert got.stamp[1] == got.stamp[2] == T0_NS and got.stamp[0] == 0


def test_times_keep_the_hundred_nanoseconds_and_the_picoseconds_of_the_wire():
    ticks = UNIX + 12_345_678_901_234_567
    row = struct.pack('<IBBdqH', 3, 0x01 | 0x04 | 0x10, 11, 0.5, ticks, 4200)
    for count in (1, 9):
        got = read_changes(struct.pack('<i', count) + row * count + struct.pack('<i', -1))
        assert got.stamp == [1_234_567_890_123_456_700 + 42] * count


@pytest.mark.parametrize('cut', [0, 3, 9, 20, 100])
def test_cut_bytes_are_refused(cut):
    whole = body(*[value(0.5, SourceTimestamp=T0) for _ in range(20)])
    with pytest.raises(WireError):
        read_changes(whole[:cut])


def test_a_count_that_lies_is_refused():
    with pytest.raises(WireError, match='announced'):
        read_changes(struct.pack('<i', 2**31 - 1) + b'\0' * 50)
