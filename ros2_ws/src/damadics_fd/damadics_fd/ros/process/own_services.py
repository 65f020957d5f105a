# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keep what rclpy itself serves from ending the process."""

from collections.abc import Callable
from typing import TypeVar

from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node

from damadics_fd.core.text import NAME, SENTENCE, plain

Request = TypeVar('Request')
Response = TypeVar('Response')


def contain(node: Node) -> None:
    """
    Answer requests that rclpy's own services cannot fulfil, instead of raising.

    rclpy 7.1 raises out of a lifecycle transition that does not fit the present state, and the
    exception leaves the executor. The answer is then what an untouched response says: no success.

    :param node: its services so far: parameters, type description, lifecycle.
    """
    for service in node.services:
        service.callback = _contained(node, service.srv_name, service.callback)


def _contained(
    node: Node, name: str, serve: Callable[[Request, Response], Response]
) -> Callable[[Request, Response], Response]:
    def served(request: Request, response: Response) -> Response:
        wanted = ''
        if isinstance(request, ChangeState.Request):
            transition = request.transition
            transition.label = plain(transition.label, NAME)  # rcl logs it as it is
            wanted = f' transition {transition.id} {transition.label}'
        try:
            return serve(request, response)
        except Exception as error:
            text = plain(str(error), SENTENCE)
            node.get_logger().warning(f'{name}: refused{wanted}: {text}'[:300])
            return response

    return served
