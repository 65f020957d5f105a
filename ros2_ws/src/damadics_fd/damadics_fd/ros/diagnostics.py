# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Publish a node's health on `/diagnostics` once a second and at once when its level changes."""

from collections.abc import Callable, Mapping
from enum import IntEnum
from functools import lru_cache

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.node import Node

from damadics_fd.core.text import SENTENCE, plain
from damadics_fd.ros.entities import Entities


class Level(IntEnum):
    """Level of a diagnostic status, as in `diagnostic_msgs/DiagnosticStatus`."""

    OK = 0
    WARN = 1
    ERROR = 2


Report = tuple[Level, str, Mapping[str, object]]


class Diagnostics:
    """
    Publisher of one diagnostic status.

    :param node: the node that is reported on.
    :param entities: of the node.
    :param hardware_id: tag of the actuator.
    :param report: returns level, one sentence and key-values, units in the keys; it is called
        once a second of wall time, so that it works while simulated time stands still.
    """

    def __init__(
        self, node: Node, entities: Entities, hardware_id: str, report: Callable[[], Report]
    ) -> None:
        self._name = f'{node.get_fully_qualified_name().lstrip("/")}: {hardware_id}'
        self._hardware_id = hardware_id
        self._report = report
        self._level: Level | None = None
        self._values: dict[str, KeyValue] = {}  # kept: to make them anew each second costs more
        self._board = entities.board(self._status)

    def publish(self) -> None:
        """Publish the present status."""
        self._board.publish([self._status()])

    def _status(self) -> DiagnosticStatus:
        level, message, values = self._report()
        self._level = level
        return DiagnosticStatus(
            level=bytes([level]),
            name=self._name,
            message=_plain(message),
            hardware_id=self._hardware_id,
            values=[self._valued(key, value) for key, value in values.items()],
        )

    def _valued(self, key: str, value: object) -> KeyValue:
        text = _text(value)
        known = self._values.get(key)
        if known is None:
            known = self._values[key] = KeyValue(key=key)
        if known.value != text:
            known.value = text
        return known

    def check(self) -> None:
        """Publish at once if the level has changed since the last message."""
        if self._report()[0] != self._level:
            self.publish()


def _text(value: object) -> str:
    if isinstance(value, float):
        return f'{value:.6g}'
    return str(value) if isinstance(value, int) else _plain(str(value))


@lru_cache(4096)  # most texts are those of a second ago
def _plain(text: str) -> str:
    return plain(text, SENTENCE)
