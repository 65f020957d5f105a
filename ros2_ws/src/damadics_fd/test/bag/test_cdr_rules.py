# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""CDR as rosidl writes it: structs without members, wide strings, types within types."""

import struct

import numpy as np
import pytest
from damadics_fd.bag import BagError, read_columns
from damadics_fd.bag.cdr.definition import parse_definition, schema_text
from damadics_fd.bag.cdr.layout import layout_of
from damadics_fd.bag.mcap.writer import McapWriter

pytestmark = pytest.mark.plain

PARTS = f"""
{'=' * 80}
MSG: a/Empty
{'=' * 80}
MSG: a/Constants
uint8 ONE=1
string NAME=hello
{'=' * 80}
MSG: a/Holder
Empty inner
float64 y
"""
SHAPES = [
    'Empty e\nfloat64 v',
    'float64 v\nEmpty e',
    'Constants c\nfloat64 v\nfloat64 w',
    'uint8 b\nEmpty e\nfloat64 v\nConstants c\nuint8 d',
    'Empty[3] e\nfloat64 v',
    'Constants[2] c\nuint16 v\nEmpty e',
    'Empty[] e\nfloat64 v',
    'Constants[<=5] e\nuint8 u\nfloat32 v',
    'Holder h\nfloat64 v',
    'Holder[2] h\nint8 i\nHolder g\nfloat64 v',
    'string s\nEmpty e\nint64 v\nstring t\nConstants c',
    'Empty e\nConstants c\nEmpty f\nuint8 v',
]


def example(mcap_ros2, members: str) -> tuple[bytes, object]:
    """Serialise a message with mcap-ros2-support."""
    from mcap_ros2._dynamic import generate_dynamic, serialize_dynamic

    text = members + PARTS
    value = iter(range(1, 100))

    def filled(kind: str) -> object:
        if kind == 'Empty' or kind == 'Constants':
            return {}
        if kind == 'Holder':
            return {'inner': {}, 'y': float(next(value))}
        return f's{next(value)}' if kind == 'string' else next(value)

    message = {}
    for line in members.splitlines():
        kind, name = line.split()
        base, bracket, count = kind.partition('[')
        length = {'3]': 3, '2]': 2, ']': 3, '<=5]': 4}[count] if bracket else None
        message[name] = filled(base) if length is None else [filled(base) for _ in range(length)]
    data = serialize_dynamic('a/B', text)['a/B'](message)
    return bytes(data), generate_dynamic('a/B', text)['a/B'](data)


@pytest.mark.parametrize('members', SHAPES)
def test_structs_without_members_take_a_byte_as_mcap_ros2_support_has_it(members, tmp_path):
    mcap_ros2 = pytest.importorskip('mcap_ros2')
    data, theirs = example(mcap_ros2, members)
    definition = parse_definition('a/msg/B', members + PARTS)
    layout = layout_of(definition, 'a/msg/B', data)
    assert layout.size <= len(data) <= layout.size + 3
    ours = np.frombuffer(data.ljust(layout.size, b'\0'), layout.dtype())[0]
    for place in layout.places:
        value = theirs
        for name in place.name.split('.'):
            value = value[int(name)] if name.isdigit() else getattr(value, name)
        found = ours[place.name]
        assert (found.decode() if place.text else found) == value, place


def store_with(members: str):
    typesys = pytest.importorskip('rosbags.typesys')
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    for kind, text in (
        ('a/msg/Empty', ''),
        ('a/msg/Constants', 'uint8 ONE=1'),
        ('a/msg/Holder', 'a/Empty inner\nfloat64 y'),
        ('a/msg/B', members),
    ):
        store.register(typesys.get_types_from_msg(text, kind))
    return store


@pytest.mark.parametrize('members', SHAPES)
def test_structs_without_members_take_a_byte_as_rosbags_has_it(members):
    pytest.importorskip('mcap_ros2')
    data, _ = example(None, members)
    message = store_with(members).deserialize_cdr(data, 'a/msg/B')
    layout = layout_of(parse_definition('a/msg/B', members + PARTS), 'a/msg/B', data)
    ours = np.frombuffer(data.ljust(layout.size, b'\0'), layout.dtype())[0]
    assert ours['v'] == message.v


def bag_of(path, members: str, payloads: list[bytes]) -> None:
    with path.open('wb') as stream:
        writer = McapWriter(stream)
        schema = writer.add_schema('a/msg/B', 'ros2msg', (members + PARTS).encode())
        channel = writer.add_channel(schema, '/a', 'cdr', {})
        for i, data in enumerate(payloads):
            writer.add_message(channel, data, i, i)
        writer.finish()


def test_a_constant_between_header_and_fields_shifts_nothing(tmp_path):
    payloads = [
        b'\0\1\0\0' + b'\0' + bytes(7) + struct.pack('<dd', 0.5 + i, 0.25 + i) for i in range(3)
    ]
    bag_of(tmp_path / 'a.mcap', 'Constants c\nfloat64 cv\nfloat64 x1', payloads)
    columns = read_columns(tmp_path / 'a.mcap', '/a')
    assert columns['cv'].tolist() == [0.5, 1.5, 2.5]
    assert columns['x1'].tolist() == [0.25, 1.25, 2.25]


@pytest.mark.parametrize('end', ['', '\n'])
def test_definitions_are_parted_by_a_line_of_their_own(tmp_path, monkeypatch, end):
    """A .msg file need not end with a line end: sensor_msgs/MagneticField does not."""
    folder = tmp_path / 'share' / 'some_msgs' / 'msg'
    folder.mkdir(parents=True)
    (folder / 'A.msg').write_text('B b\nfloat64 v  # [m]' + end)
    (folder / 'B.msg').write_text('C c' + end)
    (folder / 'C.msg').write_text('float32[2] w  # [s]' + end)
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    text = schema_text.__wrapped__('some_msgs/msg/A')
    rule = '=' * 80
    assert [line for line in text.splitlines() if '=' in line or 'MSG' in line] == [
        *(rule, 'MSG: some_msgs/B'),
        *(rule, 'MSG: some_msgs/C'),
    ]
    read = parse_definition('some_msgs/msg/A', text)
    assert read == parse_definition('some_msgs/msg/A', text.replace(f'\n{rule}', rule))
    assert read['some_msgs/msg/A'][1] == ('v', 'float64', None)


def test_an_empty_message_may_come_without_its_byte(tmp_path):
    for data in (b'\0\1\0\0', b'\0\1\0\0\0'):
        assert layout_of({'a/msg/E': []}, 'a/msg/E', data).places == ()


@pytest.mark.parametrize('order', ['<', '>'])
@pytest.mark.parametrize('text', ['', 'h', 'héllo wörld', 'valve \N{WRENCH}'])
def test_wide_strings_are_four_bytes_a_unit_as_rosidl_writes_them(tmp_path, text, order):
    units = np.frombuffer(text.encode('utf-16-le'), '<u2').astype(f'{order}u4')
    head = b'\0\1\0\0' if order == '<' else bytes(4)
    body = struct.pack(f'{order}I', len(units)) + units.tobytes()
    data = head + body
    data += bytes(-(len(data) - 4) % 8) + struct.pack(f'{order}d', 2.5)
    bag_of(tmp_path / 'a.mcap', 'wstring w\nfloat64 v', [data] * 3)
    assert read_columns(tmp_path / 'a.mcap', '/a')['v'].tolist() == [2.5] * 3
    assert read_columns(tmp_path / 'a.mcap', '/a', ['w'])['w'].tolist() == [text] * 3


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('a/B b', 'nested more than'),
        ('float64[' + '9' * 5000 + '] a', 'endless array'),
        ('float64[9999999999] a', 'shorter than its definition'),
        ('Unknown u', 'does not define'),
        ('?', 'no field'),
    ],
)
def test_hostile_definitions_are_one_typed_error(text, reason):
    with pytest.raises(BagError, match=reason):
        layout_of(parse_definition('a/msg/B', text), 'a/msg/B', b'\0\1\0\0' + bytes(100))


@pytest.mark.parametrize('name', ['x', '', '../../../etc/passwd', 'a/B', 'a/srv/B', 'é/ü'])
def test_the_type_is_taken_by_its_place_whatever_its_name(tmp_path, name):
    with (tmp_path / 'a.mcap').open('wb') as stream:
        writer = McapWriter(stream)
        schema = writer.add_schema(name, 'ros2msg', b'float64 v')
        channel = writer.add_channel(schema, 'a', 'cdr', {})
        writer.add_message(channel, b'\0\1\0\0' + struct.pack('<d', 1.5), 0, 0)
        writer.finish()
    assert read_columns(tmp_path / 'a.mcap', 'a')['v'].tolist() == [1.5]
    assert read_columns(tmp_path / 'a.mcap', '/a')['v'].tolist() == [1.5]
