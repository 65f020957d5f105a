# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The services of an operator: acknowledge, reset, shelve."""

from collections.abc import Callable
from typing import Any

from damadics_msgs.srv import Acknowledge, ResetAlarm, Shelve
from rclpy.node import Node

from damadics_fd.core.decision.detector import Detector, Outcome


class OperatorServices:
    """
    Serve the requests of operators; each answer says what was done or why not.

    :param node: the node.
    :param core: the detector.
    :param done: called with what came about and with who wanted it and why.
    """

    def __init__(self, node: Node, core: Detector, done: Callable[[Outcome, str], None]) -> None:
        self._node = node
        self._core = core
        self._done = done
        node.create_service(Acknowledge, 'acknowledge', self._acknowledge)
        node.create_service(ResetAlarm, 'reset', self._reset)
        node.create_service(Shelve, 'shelve', self._shelve)

    def _acknowledge(self, request: Any, response: Any) -> Any:
        return self._serve(self._core.acknowledge(request.occurrence or None), request, response)

    def _reset(self, request: Any, response: Any) -> Any:
        return self._serve(self._core.reset_alarm(), request, response)

    def _shelve(self, request: Any, response: Any) -> Any:
        seconds = request.duration
        outcome = self._core.shelve(seconds) if seconds else self._core.unshelve()
        return self._serve(outcome, request, response)

    def _serve(self, outcome: Outcome, request: Any, response: Any) -> Any:
        response.success, response.message = outcome.done, outcome.text
        remark = signed(request.user, request.comment)
        self._node.get_logger().info(f'{outcome.text}{remark}')
        if outcome.events:
            self._done(outcome, remark)
        return response


def signed(user: str, comment: str) -> str:
    """
    Word who did something and why.

    :param user: name, '' if not given.
    :param comment: reason, '' if not given.
    :return: the end of a sentence.

    >>> signed('Anna', 'packing replaced')
    ', by Anna: packing replaced'
    """
    return (f', by {user}' if user else '') + (f': {comment}' if comment else '')
