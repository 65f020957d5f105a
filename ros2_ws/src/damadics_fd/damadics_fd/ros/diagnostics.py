# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Publish a node's health on `/diagnostics` once a second and at once when its level changes."""

from collections.abc import Callable, Mapping
from enum import IntEnum

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
            message=plain(message, SENTENCE),
            hardware_id=self._hardware_id,
            values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()],
        )

    def check(self) -> None:
        """Publish at once if the level has changed since the last message."""
        if self._report()[0] != self._level:
            self.publish()


def _text(value: object) -> str:
    return f'{value:.6g}' if isinstance(value, float) else plain(str(value), SENTENCE)
