# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an estimator has learned: taken up at the start, kept, saved and loaded on request."""

from collections.abc import Callable
from pathlib import Path

from damadics_msgs.msg import OperatorAction
from damadics_msgs.srv import Reference as Service
from rclpy.node import Node

from damadics_fd.core.estimating import Estimating
from damadics_fd.core.settings import Settings
from damadics_fd.core.text import plain
from damadics_fd.nodes.operator import OperatorActions
from damadics_fd.ros.entities import Entities
from damadics_fd.store.references import (
    NoReferenceError,
    Reference,
    load_reference,
    reference_path,
    save_reference,
)

RETRY = 10.0  # s of wall time between two tries to keep what was learned


class ReferenceKeeper:
    """
    Keep what is learned in the file of the parameter `reference`; serve who asks for another.

    :param node: the estimator's node.
    :param entities: of the node.
    :param actions: the record of what people do.
    :param core: the estimator.
    :param actuator: tag.
    :param settings: that it learns with.
    :param path: of the file, absolute, without slot and suffix; None for none.
    """

    def __init__(
        self,
        node: Node,
        entities: Entities,
        actions: OperatorActions,
        core: Estimating,
        actuator: str,
        settings: Settings,
        path: Path | None,
    ) -> None:
        self._log = node.get_logger()
        self._actions = actions
        self._core = core
        self._actuator = actuator
        self._settings = settings
        self._path = path
        self.problem = ''  # why what was learned is not kept
        entities.service(Service, 'save_reference', self._save_service)
        entities.service(Service, 'load_reference', self._load_service)
        if path:
            entities.timer(RETRY, self._keep_again)

    def restore(self) -> None:
        """Take up the reference where there is one."""
        if self._path is None:
            return
        done, text = self._load(self._path)
        if done:  # rclpy takes one severity from each line of the source
            self._log.info(text)
        else:
            self._log.warning(text)

    def keep(self) -> None:
        """Keep what was just learned; where that fails, it is told and tried again."""
        if self._path is None:
            return
        done, text = self._save(self._path)
        self.problem = '' if done else text
        if done:
            self._log.info(text)
        else:
            self._log.error(text, throttle_duration_sec=60.0)

    def _keep_again(self) -> None:
        if self.problem and self._core.monitoring:
            self.keep()

    def _save(self, path: Path) -> tuple[bool, str]:
        try:
            reference = Reference(
                self._actuator,
                self._core.learned(),
                self._settings.to_dict(),
                source='live',
                last_stamp=self._core.last_stamp,
            )
            return True, f'reference saved: {save_reference(path, reference)}'
        except (ValueError, OSError) as problem:
            return False, f'reference not saved: {problem}'

    def _load(self, path: Path) -> tuple[bool, str]:
        try:
            reference = load_reference(path, self._actuator, self._settings)
            self._core.restore(reference.learned)
        except NoReferenceError as problem:
            return False, f'no reference, the valve is learned: {problem}'
        except ValueError as problem:
            return False, f'reference refused, the valve is learned: {problem}'
        return True, f'reference loaded: {path}, {plain(reference.source)}'

    def _save_service(
        self, request: Service.Request, response: Service.Response
    ) -> Service.Response:
        return self._serve(OperatorAction.SAVE_REFERENCE, request, response, self._save)

    def _load_service(
        self, request: Service.Request, response: Service.Response
    ) -> Service.Response:
        return self._serve(OperatorAction.LOAD_REFERENCE, request, response, self._load)

    def _serve(
        self,
        action: int,
        request: Service.Request,
        response: Service.Response,
        act: Callable[[Path], tuple[bool, str]],
    ) -> Service.Response:
        try:
            path = reference_path(request.path, self._path)
        except ValueError as problem:
            response.message = str(problem)
        else:
            response.success, response.message = act(path)
        stamp = self._core.last_stamp
        self._actions.tell(action, response.success, response.message, stamp=stamp)
        return response
