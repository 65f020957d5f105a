# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
from typing import TypeAlias

Value: TypeAlias = bool | int | float | str | list[bool] | list[int] | list[float] | list[str]

class Parameter:
    def __init__(self, name: str, *, value: Value | None = None) -> None: ...
    @property
    def name(self) -> str: ...
    @property
    def value(self) -> Value | None: ...
