# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from typing import TypeVar

M = TypeVar('M')

def deserialize_message(serialized_message: bytes, message_type: type[M]) -> M: ...
def serialize_message(message: object) -> bytes: ...
