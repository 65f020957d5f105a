# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The event stream as a browser reads it."""

import json
from collections.abc import Iterable, Iterator
from typing import NamedTuple


class Message(NamedTuple):
    """A message of the stream."""

    number: str  # for Last-Event-ID; empty where none was given
    name: str
    data: dict


def messages(lines: Iterable[str]) -> Iterator[Message]:
    """Read messages, each as soon as its data have come."""
    number = name = ''
    for line in lines:
        field, _, value = line.partition(': ')
        if field == 'id':
            number = value
        elif field == 'event':
            name = value
        elif field == 'data':
            yield Message(number, name, json.loads(value))
