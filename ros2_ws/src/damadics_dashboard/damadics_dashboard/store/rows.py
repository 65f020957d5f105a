# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rows of the history: transitions of alarms, and what people did."""

from typing import TypeAlias, TypedDict

Cell: TypeAlias = str | int | float | None


class EventRow(TypedDict, total=False):
    """A transition of an alarm; None where a number is not known."""

    valve: str
    stamp: int  # ns
    seen: float  # s, time of arrival
    transition: int
    occurrence: int
    level: int
    onset: int  # ns
    residual: float | None
    threshold: float | None
    ratio: float | None
    duration: float | None  # s
    cause: str
    confidence: float | None
    strength: float | None
    text: str
    advice: str
    unseen: float | None  # s of the duration without data
    deviation: float  # this and the next: not in the history
    found_by: str


class ActionRow(TypedDict, total=False):
    """What a person did."""

    valve: str
    seen: float  # s, time of arrival
    action: str
    user: str
    role: str
    comment: str
    done: int  # 1: it was done
    result: str
