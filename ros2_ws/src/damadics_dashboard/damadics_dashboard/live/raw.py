# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read serialised messages in batches: a page needs ten looks a second, not every message."""

from functools import cache

import numpy as np
from damadics_fd.bag.cdr.definition import Definition, parse_definition, schema_text
from damadics_fd.bag.cdr.layout import Layout, layout_of
from damadics_fd.core.stamps import SECOND as NANO

TOPICS: tuple[tuple[str, str, dict[str, str]], ...] = (  # with type, and columns
    (
        'measurement',
        'Measurement',
        {name: name for name in ('cv', 'x1', 'p1', 'p2', 'flow', 't1', 'ps')},
    ),
    (
        'estimate',
        'Estimate',
        {
            'x2': 'x2',
            'residual': 'xi2',
            'u': 'u',
            'x': 'x1',
            'progress': 'progress',
            'phase': 'phase',
        },
    ),
    ('threshold', 'Float64Stamped', {'rho': 'data'}),
)


@cache
def _definition(kind: str) -> Definition:
    return parse_definition(kind, schema_text(kind))


class Batch:
    """
    Messages of one topic as they came from the wire, and their columns.

    :param kind: full type name, such as `damadics_msgs/msg/Measurement`.
    :param columns: field of the message by name of the column.
    """

    def __init__(self, kind: str, columns: dict[str, str]) -> None:
        self._kind = kind
        self._columns = columns
        self._messages: list[bytes] = []
        self._layout: Layout | None = None
        self.dtype = np.dtype([('stamp', 'i8'), *((name, 'f8') for name in columns)])

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns beside `stamp`."""
        return tuple(self._columns)

    def take(self, message: bytes) -> None:
        """Keep one message; cheap, for it is called for each."""
        self._messages.append(message)

    def drain(self) -> np.ndarray:
        """
        Return the columns of all messages since the last call.

        :return: structured array with `stamp` [ns] and the columns.
        """
        messages, self._messages = self._messages, []
        parts = []
        while messages:
            size = len(messages[0])
            run = next((n for n, m in enumerate(messages) if len(m) != size), len(messages))
            parts.append(self._decode(messages[:run], size))
            messages = messages[run:]
        return np.concatenate(parts) if parts else np.zeros(0, self.dtype)

    def _decode(self, messages: list[bytes], size: int) -> np.ndarray:
        data = np.frombuffer(b''.join(messages), np.uint8).reshape(-1, size)
        if self._layout is None or not self._layout.matches(data):
            self._layout = layout_of(_definition(self._kind), self._kind, messages[0])
            if not self._layout.matches(data):  # one size, other lengths inside
                return np.concatenate([self._decode([m], size) for m in messages])
        source = data.view(self._layout.dtype(size))[:, 0]
        rows = np.zeros(len(data), self.dtype)
        rows['stamp'] = (
            source['header.stamp.sec'].astype(np.int64) * NANO + source['header.stamp.nanosec']
        )
        for name, path in self._columns.items():
            rows[name] = source[path]
        return rows


def batches() -> dict[str, Batch]:
    """
    Return what takes the samples of one valve.

    :return: batches by topic.
    """
    return {name: Batch(f'damadics_msgs/msg/{kind}', columns) for name, kind, columns in TOPICS}
