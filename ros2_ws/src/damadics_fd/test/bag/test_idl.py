# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Definitions as IDL are those as text."""

import struct
import time

import pytest
from damadics_fd.bag import BagError, read_columns
from damadics_fd.bag.cdr.definition import (
    PRIMITIVES,
    Definition,
    _share_file,
    parse_definition,
    schema_text,
)
from damadics_fd.bag.cdr.idl import parse_idl
from damadics_fd.bag.mcap.writer import McapWriter

pytestmark = pytest.mark.plain

SECTION = '=' * 80 + '\nIDL: {}\n{}\n'
OWN = """
// "written" by hand
#include "std_msgs/msg/Header.idl"
module other {
  module msg {
    module Valve_Constants { const string TEXT = "a // b; }"; const long FEW = 3; };
    typedef double three[3];
    enum State { OPEN, CLOSED };
    /* a comment with a brace { */
    @verbatim (language="comment", text="from https://example.org (sic)" "\\n" "x")
    struct Valve {
      std_msgs::msg::Header header;
      @default (value=0.5) @unit(value="1")
      double cv;
      other::msg::three axes;
      sequence<string<10>, 4> names;
      wstring<5> title;
      State state;
      long long count;
      unsigned long long x;
      double x1;
    };
  };
};
"""
TEXT = """
std_msgs/Header header
float64 cv
float64[3] axes
string<=10[<=4] names
wstring<=5 title
uint32 state
int64 count
uint64 x
float64 x1
"""


def codes(definition: Definition) -> dict[str, list[tuple[str, str, int | None]]]:
    """Return a definition with the codes of primitive types, of which some have two names."""
    return {
        kind: [(m.name, PRIMITIVES.get(m.type, m.type), m.repeat) for m in members]
        for kind, members in definition.items()
    }


def idl_of(kinds) -> str:
    return ''.join(SECTION.format(kind, _share_file(kind, '.idl').read_text()) for kind in kinds)


def installed() -> list[str]:
    """Return the types of some installed packages."""
    try:
        share = _share_file('std_msgs/msg/Header', '.idl').parents[2]
    except BagError:
        return []
    packages = ('std_msgs', 'sensor_msgs', 'geometry_msgs', 'diagnostic_msgs', 'rcl_interfaces')
    files = [file for name in packages for file in sorted((share / name / 'msg').glob('*.msg'))]
    return [f'{file.parents[1].name}/msg/{file.stem}' for file in files]


def test_types_as_idl_are_the_types_as_text():
    kinds = installed()
    if not kinds:
        pytest.skip('no interface files are installed: run make build and source env.sh')
    assert len(kinds) > 50
    for kind in kinds:
        wanted = parse_definition(kind, schema_text(kind))
        if not all(wanted.values()):
            continue  # its IDL has a member in place of none
        assert codes(parse_idl(kind, idl_of(wanted))) == codes(wanted), kind


def header_text() -> tuple[str, str]:
    try:
        text = schema_text('std_msgs/msg/Header')
        return idl_of(['std_msgs/msg/Header', 'builtin_interfaces/msg/Time']), text
    except BagError:
        pytest.skip('no interface files are installed: run make build and source env.sh')


def test_what_idl_may_say_is_read():
    idl, header = header_text()
    wanted = parse_definition(
        'other/msg/Valve', TEXT + '=' * 80 + '\nMSG: std_msgs/Header\n' + header
    )
    assert codes(parse_idl('other/msg/Valve', idl + OWN)) == codes(wanted)


def test_a_bag_with_idl_is_read_as_one_with_text(tmp_path):
    idl, header = header_text()
    text = TEXT + '=' * 80 + '\nMSG: std_msgs/Header\n' + header
    found = []
    for encoding, definition in (('ros2msg', text), ('ros2idl', idl + OWN)):
        path = tmp_path / f'{encoding}.mcap'
        with path.open('wb') as stream:
            writer = McapWriter(stream)
            kind = writer.add_schema('other/msg/Valve', encoding, definition.encode())
            topic = writer.add_channel(kind, '/valve', 'cdr', {})
            head = struct.pack('<iII4s', 1, 2, 3, b'lv')
            body = struct.pack('<4d3I4xqQd', 0.5, 1.0, 2.0, 3.0, 0, 0, 1, -4, 5, 0.25)
            writer.add_message(topic, b'\0\1\0\0' + head + body, 7, 7)
            writer.finish()
        found.append(read_columns(path, '/valve', ['cv', 'count', 'x1']))
    for columns in found:
        assert columns['stamp'].tolist() == [1_000_000_002]
        assert columns['cv'].tolist() == [0.5]
        assert columns['count'].tolist() == [-4]
        assert columns['x1'].tolist() == [0.25]


@pytest.mark.parametrize(
    'text',
    [
        '',
        'struct',
        'module a { struct B { ',
        'module a { struct B { double x[99999999999]; }; };',
        'module a { struct B { nothing x; }; };',
        'module a { struct C { double x; }; };',
        'module a { typedef double m[3]; struct B { m x[3]; }; };',
        '"' + '\\"' * 300_000,
        '/*' * 300_000,
        '@a(' * 300_000,
        'sequence<' * 100_000,
        'module a { struct B { ' + 'sequence<' * 100_000,
    ],
)
def test_idl_that_is_none_is_refused_at_once(text):
    began = time.process_time()
    with pytest.raises(BagError):
        parse_idl('a/msg/B', text)
    assert time.process_time() - began < 5.0
