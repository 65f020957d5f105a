# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A wrong length of one record costs no other record, and what is damaged is not copied."""

import struct

import pytest
from damadics_fd.bag.checking.inspection import LOSSY, WHOLE, inspect
from damadics_fd.bag.mcap.records import HEAD, MAGIC, Op
from damadics_fd.bag.salvage import salvage

from .test_conformance import Maker, raw
from .test_damage import CHUNKS, ROWS, small_bag

pytestmark = pytest.mark.plain


def records(data: bytes) -> list[tuple[int, int, int]]:
    """Return opcode, begin and end of each record of a whole file."""
    at, found = len(MAGIC), []
    while at < len(data) - len(MAGIC):
        op, length = HEAD.unpack_from(data, at)
        found.append((op, at, at + HEAD.size + length))
        at = found[-1][2]
    return found


@pytest.mark.parametrize('wrong', [0, 5, 1 << 8, 1 << 12, 1 << 40, (1 << 64) - 1])
@pytest.mark.parametrize('op', [Op.SCHEMA, Op.CHANNEL, Op.CHUNK, Op.MESSAGE_INDEX, Op.METADATA])
def test_a_wrong_length_costs_nothing(op, wrong, tmp_path):
    path = tmp_path / 'a.mcap'
    small_bag(path)
    data = bytearray(path.read_bytes())
    begin = next(begin for kind, begin, _ in records(bytes(data)) if kind == op)
    (length,) = struct.unpack_from('<Q', data, begin + 1)
    struct.pack_into('<Q', data, begin + 1, length ^ wrong if 5 < wrong < 1 << 63 else wrong)
    path.write_bytes(data)
    report = inspect(path)
    assert (report.code, report.messages) == (LOSSY, CHUNKS * ROWS)
    assert any(f'the length of the {op.name} record is damaged' in t for t in report.problems)
    result = salvage(path, tmp_path / 'b.mcap')
    assert (result.code, result.saved.code, result.saved.messages) == (LOSSY, WHOLE, CHUNKS * ROWS)


@pytest.mark.parametrize('op', [Op.ATTACHMENT, Op.METADATA])
def test_an_attachment_with_a_wrong_length_is_copied_with_the_right_one(op, tmp_path):
    path = tmp_path / 'a.mcap'
    whole = Maker({'chunk', 'statistics', 'crc', 'repeat'}, 'all').build()
    path.write_bytes(whole)
    (record,) = raw(path, op)
    path.write_bytes(whole.replace(record, record[:1] + b'\xff' + record[2:]))
    assert salvage(path, tmp_path / 'b.mcap').saved.code == WHOLE
    assert raw(tmp_path / 'b.mcap', op) == [record]


@pytest.mark.parametrize(
    ('op', 'text'), [(Op.METADATA, b'm\x08'), (Op.ATTACHMENT, b'data'), (Op.ATTACHMENT, b'n\x0a')]
)
def test_damaged_attachments_and_metadata_are_left_out_of_what_is_recovered(op, text, tmp_path):
    path = tmp_path / 'a.mcap'
    whole = Maker({'chunk', 'statistics', 'crc', 'repeat'}, 'all').build()
    path.write_bytes(whole)
    (record,) = raw(path, op)
    at = record.find(text) if text != b'm\x08' else record.find(struct.pack('<I', 10))
    assert at >= 0
    damaged = record[:at] + b'\xff' + record[at + 1 :]
    path.write_bytes(whole.replace(record, damaged))
    assert inspect(path).code == LOSSY
    result = salvage(path, tmp_path / 'b.mcap')
    assert (result.code, result.saved.code, result.saved.messages) == (LOSSY, WHOLE, 7)
    assert raw(tmp_path / 'b.mcap', op) == []
