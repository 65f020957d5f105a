# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The payload of Sparkplug B, as the specification defines it for Protocol Buffers.

Field numbers and types are those of Sparkplug 3.0.0, section 6.4.1 (package
`org.eclipse.tahu.protobuf`). Data sets, templates and metadata are not declared: Protocol Buffers
carry fields that a reader does not know, and a valve has none of them.
"""

import math
from collections.abc import Mapping, Sequence

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError, Message

NAMESPACE = 'spBv1.0'
INT8, INT16, INT32, INT64, UINT8, UINT16, UINT32, UINT64 = range(1, 9)
FLOAT, DOUBLE, BOOLEAN, STRING, DATETIME, TEXT = range(9, 15)
SIGNED = {INT8: 8, INT16: 16, INT32: 32, INT64: 64}
GOOD = 192  # of the property Quality
REBIRTH = 'Node Control/Rebirth'
BIRTH = 'bdSeq'
_F = descriptor_pb2.FieldDescriptorProto
_PACKAGE = 'org.eclipse.tahu.protobuf'
_VALUES = (
    ('int_value', _F.TYPE_UINT32),
    ('long_value', _F.TYPE_UINT64),
    ('float_value', _F.TYPE_FLOAT),
    ('double_value', _F.TYPE_DOUBLE),
    ('boolean_value', _F.TYPE_BOOL),
    ('string_value', _F.TYPE_STRING),
)


class PayloadError(ValueError):
    """The bytes are no Sparkplug B payload."""


def _message(
    parent: Message,
    name: str,
    fields: Sequence[tuple[str, int, int, int, str]],
    values_from: int = 0,
) -> None:
    """Declare a message: (name, number, type, label, type name), then a oneof of values."""
    declared = parent.nested_type.add(name=name)
    if values_from:
        declared.oneof_decl.add(name='value')
    for field, number, kind, label, type_name in fields:
        added = declared.field.add(name=field, number=number, type=kind, label=label)
        if type_name:
            added.type_name = type_name
    for n, (field, kind) in enumerate(_VALUES if values_from else ()):
        declared.field.add(
            name=field,
            number=values_from + n,
            type=kind,
            label=_F.LABEL_OPTIONAL,
            oneof_index=0,
        )


def _classes() -> tuple[type[Message], type[Message]]:
    file = descriptor_pb2.FileDescriptorProto(
        name='sparkplug_b.proto', package=_PACKAGE, syntax='proto2'
    )
    one, many, kind = _F.LABEL_OPTIONAL, _F.LABEL_REPEATED, _F.TYPE_MESSAGE
    payload = file.message_type.add(name='Payload')
    inner = f'.{_PACKAGE}.Payload.'
    _message(
        payload,
        'PropertyValue',
        [('type', 1, _F.TYPE_UINT32, one, ''), ('is_null', 2, _F.TYPE_BOOL, one, '')],
        3,
    )
    _message(
        payload,
        'PropertySet',
        [
            ('keys', 1, _F.TYPE_STRING, many, ''),
            ('values', 2, kind, many, inner + 'PropertyValue'),
        ],
    )
    _message(
        payload,
        'Metric',
        [
            ('name', 1, _F.TYPE_STRING, one, ''),
            ('alias', 2, _F.TYPE_UINT64, one, ''),
            ('timestamp', 3, _F.TYPE_UINT64, one, ''),
            ('datatype', 4, _F.TYPE_UINT32, one, ''),
            ('is_historical', 5, _F.TYPE_BOOL, one, ''),
            ('is_transient', 6, _F.TYPE_BOOL, one, ''),
            ('is_null', 7, _F.TYPE_BOOL, one, ''),
            ('properties', 9, kind, one, inner + 'PropertySet'),
        ],
        10,
    )
    for name, number, of, label in (
        ('timestamp', 1, _F.TYPE_UINT64, one),
        ('metrics', 2, kind, many),
        ('seq', 3, _F.TYPE_UINT64, one),
        ('uuid', 4, _F.TYPE_STRING, one),
        ('body', 5, _F.TYPE_BYTES, one),
    ):
        added = payload.field.add(name=name, number=number, type=of, label=label)
        if of == kind:
            added.type_name = inner + 'Metric'
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    found = pool.FindMessageTypeByName(f'{_PACKAGE}.Payload')
    return (
        message_factory.GetMessageClass(found),
        message_factory.GetMessageClass(found.nested_types_by_name['Metric']),
    )


Payload, Metric = _classes()


def read_payload(data: bytes) -> Message:
    """
    Read a payload.

    :param data: of a message.
    :return: the payload.
    :raises PayloadError: where it is none.
    """
    payload = Payload()
    try:
        payload.ParseFromString(data)
    except (DecodeError, UnicodeDecodeError, ValueError) as problem:
        raise PayloadError('no Sparkplug B payload') from problem
    return payload


def number_of(metric: Message) -> float:
    """
    Return the value of a metric.

    :param metric: of a payload.
    :return: the number; NaN where it is null, of bad quality or no number.
    """
    which = metric.WhichOneof('value')
    if metric.is_null or which in (None, 'string_value') or _quality(metric) != GOOD:
        return math.nan
    value = getattr(metric, which)
    bits = SIGNED.get(metric.datatype)
    if bits and value >= 1 << (bits - 1):  # negative: two's complement, or 32 bits of it
        value -= 1 << (64 if which == 'long_value' else 32 if value >= 1 << bits else bits)
        if value >= 0:
            return math.nan
    return float(value)


def birth_of(payload: Message) -> int | None:
    """
    Return the number that a birth of an edge node and the death that belongs to it share.

    :param payload: of either.
    :return: None where there is none.
    """
    for metric in payload.metrics:
        if metric.name == BIRTH and not math.isnan(number := number_of(metric)):
            return int(number)
    return None


def _quality(metric: Message) -> int:
    for key, value in zip(metric.properties.keys, metric.properties.values, strict=False):
        if key == 'Quality':
            return int(value.int_value)
    return GOOD


def write_payload(
    values: Mapping[str, str | float | bool | int], milliseconds: int, seq: int | None
) -> bytes:
    """
    Write a payload with names.

    :param values: by metric; None-like numbers are NaN and sent as null.
    :param milliseconds: since 1970.
    :param seq: 0..255; None: none, as in a death certificate.
    :return: the bytes.
    """
    payload = Payload(timestamp=milliseconds)
    if seq is not None:
        payload.seq = seq
    for name, value in values.items():
        metric = payload.metrics.add(name=name, timestamp=milliseconds)
        if isinstance(value, bool):
            metric.datatype, metric.boolean_value = BOOLEAN, value
        elif isinstance(value, int):
            metric.datatype, metric.long_value = INT64, value
        elif isinstance(value, float):
            metric.datatype = DOUBLE
            if math.isnan(value):
                metric.is_null = True
            else:
                metric.double_value = value
        else:
            metric.datatype, metric.string_value = STRING, value
    data: bytes = payload.SerializeToString()
    return data
