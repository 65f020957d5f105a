# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tell from the lengths inside a record whether it can be one."""

from damadics_fd.bag.mcap.records import HEAD, MESSAGE, Op

TEXT, DATA = -1, -2  # fields with a u32 or a u64 in front that is their size
_SHAPES: dict[Op, tuple[int, ...]] = {  # sizes of the fields in order
    Op.HEADER: (TEXT, TEXT),
    Op.FOOTER: (20,),
    Op.SCHEMA: (2, TEXT, TEXT, TEXT),
    Op.CHANNEL: (4, TEXT, TEXT, TEXT),
    Op.CHUNK: (28, TEXT, DATA),
    Op.MESSAGE_INDEX: (2, TEXT),
    Op.CHUNK_INDEX: (32, TEXT, 8, TEXT, 16),
    Op.ATTACHMENT: (16, TEXT, TEXT, DATA, 4),
    Op.ATTACHMENT_INDEX: (40, TEXT, TEXT),
    Op.STATISTICS: (42, TEXT),
    Op.METADATA: (TEXT, TEXT),
    Op.METADATA_INDEX: (16, TEXT),
    Op.SUMMARY_OFFSET: (17,),
    Op.DATA_END: (4,),
}

_FIXED = (Op.FOOTER, Op.DATA_END)  # never to be extended


def well_formed(op: Op, content: bytes, length: int) -> bool:
    """
    Tell whether a record has room for its fields.

    There may be more behind them: later versions of MCAP add fields at the end.

    :param op: its opcode.
    :param content: the beginning of its content; what lies beyond is not judged.
    :param length: length of the whole content [B].
    :return: False where the record cannot be one of this kind.

    >>> well_formed(Op.MESSAGE_INDEX, bytes.fromhex('0100 10000000') + bytes(16), 22)
    True
    >>> well_formed(Op.MESSAGE_INDEX, bytes.fromhex('0100 11000000') + bytes(16), 22)
    False
    """
    end, complete = fields_end(op, content[:length])
    return end == length if complete and op in _FIXED else end <= length


def fields_end(op: Op, content: bytes) -> tuple[int, bool]:
    """
    Return where the fields of a record end by their own lengths, whatever the record's.

    :param op: its opcode.
    :param content: the beginning of its content.
    :return: the place; False where there may be more fields than `content` shows, and for a
        message, which does not say how long it is.

    >>> fields_end(Op.MESSAGE_INDEX, bytes.fromhex('0100 10000000') + bytes(19))
    (22, True)
    """
    if op == Op.MESSAGE:
        return MESSAGE.size - HEAD.size, False
    at = 0
    for size in _SHAPES[op]:
        if size < 0:
            prefix = 4 if size == TEXT else 8
            if at + prefix > len(content):
                return at + prefix, False
            at += prefix + int.from_bytes(content[at : at + prefix], 'little')
        else:
            at += size
    return at, True
