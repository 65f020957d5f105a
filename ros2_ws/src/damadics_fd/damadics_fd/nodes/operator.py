# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What people ask of a valve's nodes: the services of an operator, and the record of each act."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol, TypeVar

from damadics_msgs.msg import OperatorAction
from damadics_msgs.srv import Acknowledge, ResetAlarm, Shelve
from rclpy.node import Node

from damadics_fd.core.decision.detector import Detector, Outcome
from damadics_fd.core.text import COMMENT, NAME, SENTENCE, plain
from damadics_fd.ros import qos
from damadics_fd.ros.conversions import set_stamp
from damadics_fd.ros.entities import Entities
from damadics_fd.store.actions import Act, ActionStore

Told = Callable[[Outcome, str], None]
Response = TypeVar('Response', bound='Answered')


class Signed(Protocol):
    """A request that says who wants it and why."""

    user: str
    comment: str


class Answered(Protocol):
    """A response that says what was done or why not."""

    success: bool
    message: str


class OperatorActions:
    """
    Publisher of `operator_action`: who did what, why, and what came of it; that of before too.

    :param node: the node.
    :param entities: of the node.
    :param actuator: tag.
    :param path: where they are kept, without suffix; None where they are not.
    """

    def __init__(self, node: Node, entities: Entities, actuator: str, path: Path | None) -> None:
        self._node = node
        self._actuator = actuator
        self._publisher = entities.publisher(OperatorAction, 'operator_action', qos.EVENTS)
        self._store = ActionStore(path)
        for act in self._store.load():
            self._publish(act)
        if self._store.problem:
            node.get_logger().error(self._store.problem)

    def tell(
        self,
        action: int,
        done: bool,
        result: str,
        *,
        stamp: int = 0,
        occurrence: int = 0,
        user: str = '',
        comment: str = '',
    ) -> str:
        """
        Log an act and publish it.

        :param action: one of the constants of OperatorAction.
        :param done: it was done.
        :param result: what was done, or why not.
        :param stamp: of the newest measurement [ns].
        :param occurrence: number of the alarm it concerned, 0 if none.
        :param user: as the request says.
        :param comment: as the request says.
        :return: the remark, for the text of an event.
        """
        user, comment = plain(user, NAME), plain(comment, COMMENT)
        remark = signed(user, comment)
        log = self._node.get_logger()
        text = plain(result, SENTENCE)
        if done:  # rclpy takes one severity from each line of the source
            log.info(f'{text}{remark}')
        else:
            log.warning(f'{text}{remark}')
        act = Act(action, max(stamp, 0), occurrence, user, '', comment, done, text)
        self._publish(act)
        self._store.add(act)
        if self._store.problem:
            log.error(self._store.problem, throttle_duration_sec=60.0)
        return remark

    def _publish(self, act: Act) -> None:
        message = OperatorAction(
            action=act.action,
            occurrence=act.occurrence,
            user=act.user,
            role=act.role,
            comment=act.comment,
            success=act.done,
            result=act.result,
        )
        message.header.frame_id = self._actuator
        set_stamp(message.header.stamp, act.stamp)
        self._publisher.publish(message)


class OperatorServices:
    """
    Serve the requests of operators; each answer says what was done or why not.

    :param entities: of the node.
    :param actions: the record.
    :param core: the detector.
    :param done: called with what came about and with who wanted it and why.
    """

    def __init__(
        self, entities: Entities, actions: OperatorActions, core: Detector, done: Told
    ) -> None:
        self._actions = actions
        self._core = core
        self._done = done
        entities.service(Acknowledge, 'acknowledge', self._acknowledge)
        entities.service(ResetAlarm, 'reset', self._reset)
        entities.service(Shelve, 'shelve', self._shelve)

    def _acknowledge(
        self, request: Acknowledge.Request, response: Acknowledge.Response
    ) -> Acknowledge.Response:
        outcome = self._core.acknowledge(request.occurrence or None)
        return self._serve(OperatorAction.ACKNOWLEDGE, outcome, request, response)

    def _reset(
        self, request: ResetAlarm.Request, response: ResetAlarm.Response
    ) -> ResetAlarm.Response:
        return self._serve(OperatorAction.RESET, self._core.reset_alarm(), request, response)

    def _shelve(self, request: Shelve.Request, response: Shelve.Response) -> Shelve.Response:
        seconds = request.duration
        outcome = self._core.shelve(seconds) if seconds else self._core.unshelve()
        return self._serve(OperatorAction.SHELVE, outcome, request, response)

    def _serve(
        self, action: int, outcome: Outcome, request: Signed, response: Response
    ) -> Response:
        response.success, response.message = outcome.done, outcome.text
        decision = self._core.decision
        remark = self._actions.tell(
            action,
            outcome.done,
            outcome.text,
            stamp=decision.stamp,
            occurrence=decision.occurrence,
            user=request.user,
            comment=request.comment,
        )
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
