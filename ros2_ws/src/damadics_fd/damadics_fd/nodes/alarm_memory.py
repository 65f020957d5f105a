# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The alarm of before a restart: taken up, or shown as lost."""

from pathlib import Path

from rclpy.node import Node

from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.stamps import another_run
from damadics_fd.store.alarms import AlarmStore


class AlarmMemory:
    """
    Keep a detector's alarm over its restart.

    :param node: the detector's node.
    :param core: the detector.
    :param path: of the files, without their suffix; None where alarms are not kept.
    """

    def __init__(self, node: Node, core: Detector, path: Path | None) -> None:
        self._node = node
        self._core = core
        self._store = AlarmStore(path) if path else None
        self._loaded: int | None = None  # stamp of the state that was taken up
        self._aside: list[Path] = []

    @property
    def problem(self) -> str:
        """Why the alarm would not survive a restart, '' if it would."""
        return self._store.problem if self._store else ''

    @property
    def values(self) -> dict[str, str]:
        """What the diagnostics should tell."""
        if not self._aside:
            return {}
        return {'Alarm state kept aside': ' '.join(map(str, self._aside))}

    def restore(self) -> bool:
        """
        Take up the alarm of before, where there is one.

        :return: whether the detector has a state to show.
        """
        if self._store is None:
            return False
        try:
            kept = self._store.load()
            if kept is None:
                return False
            self._core.load(kept.state)
        except ValueError as problem:
            self._lose(str(problem))
            return True
        self._loaded = int(self._core.state[0].stamp)
        self._node.get_logger().info(f'alarms of before taken up from {self._store.path}')
        if kept.problem:
            self._node.get_logger().error(f'one of two copies of the alarm: {kept.problem}')
            self._set_aside(damaged=True)
            self._store.save(self._core.save(), again=True)
        return True

    def begin(self, stamp: int) -> None:
        """
        Tell whether the alarm of before belongs to this run, once.

        :param stamp: of a measurement that is about to be judged [ns].
        """
        if self._loaded is None:
            return
        last, self._loaded = self._loaded, None
        if not another_run(last, stamp):
            return
        s = self._core.state[0]
        if s.active or s.latched or s.unknown or s.shelved_until > 0:
            self._lose('time begins anew: the alarm belongs to another run')
            return
        self._node.get_logger().info('time begins anew: another run, without alarm so far')
        self._core.reset()

    def keep(self) -> None:
        """Keep the alarm if it has changed, or could not be kept before."""
        if self._store is None:
            return
        before = self._store.problem
        self._store.save(self._core.save())
        if self._store.problem and self._store.problem != before:
            self._node.get_logger().error(f'{self._store.problem}; tried again every second')
        elif before and not self._store.problem:
            self._node.get_logger().info('the alarm is kept again')

    def _lose(self, cause: str) -> None:
        """Show that an alarm of before is lost, and keep that over a restart."""
        self._node.get_logger().error(
            f'the alarm of before is lost: {cause}. Look at the valve, then acknowledge'
        )
        self._core.lose()
        self._set_aside()
        if self._store:
            self._store.save(self._core.save(), again=True)

    def _set_aside(self, damaged: bool = False) -> None:
        try:
            self._aside += self._store.set_aside(damaged) if self._store else []
        except OSError as problem:
            self._node.get_logger().error(f'the old file stays where it is: {problem}')
