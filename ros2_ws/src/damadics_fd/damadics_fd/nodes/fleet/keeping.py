# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a fleet keeps over a restart: alarms and references of its valves."""

import time
from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rclpy.node import Node

from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.modes import PHASE_LEARN_ALPHA, PHASE_LEARN_PHI, PHASE_MONITOR
from damadics_fd.core.record import Ints
from damadics_fd.nodes.alarm_memory import AlarmMemory
from damadics_fd.nodes.fleet.members import Members, first_stamps
from damadics_fd.nodes.operator import OperatorActions
from damadics_fd.ros.entities import Entities
from damadics_fd.store.references import (
    NoReferenceError,
    Reference,
    load_reference,
    save_reference,
)

LEARNING = (PHASE_LEARN_ALPHA, PHASE_LEARN_PHI)
AT_ONCE = 0.2  # s of saving before the samples have their turn again


class Keeping:
    """
    Keep the alarms and references of a fleet.

    :param node: the fleet's node.
    :param members: the valves.
    :param folder: of the alarms; None where none are kept.
    """

    def __init__(self, node: Node, members: Members, folder: Path | None) -> None:
        self._node = node
        self._members = members
        self._folder = folder
        self._memories: dict[int, AlarmMemory] = {}
        self._pending: set[int] = set()  # whose alarms of before are not yet compared with a stamp
        self._kept = np.zeros(len(members), np.bool_)  # what was learned stands in a file
        self._unsaved: dict[int, str] = {}  # references that could not be saved

    @property
    def problems(self) -> list[str]:
        """What would not survive a restart."""
        alarms = [memory.problem for memory in self._memories.values() if memory.problem]
        return alarms + list(self._unsaved.values())

    def restore(self, but: Collection[int] = ()) -> None:
        """
        Take up alarms and references of before, or show what is lost.

        :param but: valves that have their whole state already.
        """
        names = set(self._names())
        for number in but:
            self.keep(number)
            self._kept[number] = True
        for number, member in enumerate(self._members.all):
            if number in but:
                continue
            if member.reference:
                self._load(number, quiet=True)
            if any(name.startswith(f'{self._file(number)}.') for name in names & self._of(number)):
                memory = self._memory(number)
                if memory.restore():
                    self._pending.add(number)

    def begin(self, valve: Ints, stamp: Ints) -> None:
        """
        Compare alarms of before with the first stamps after the start.

        :param valve: of rows that are about to be judged.
        :param stamp: of these rows [ns].
        """
        if not self._pending:
            return
        for number, first in first_stamps(self._pending, valve, stamp):
            self._memory(number).begin(first)

    def keep(self, number: int) -> None:
        """
        Keep the alarm of a valve, if it has changed.

        :param number: of the valve.
        """
        if self._folder:
            self._memory(number).keep()

    def again(self, patience: float = AT_ONCE) -> None:
        """
        Try once more what could not be kept; save references of valves that learned.

        :param patience: time after which the rest waits for the next call [s].
        """
        end = time.monotonic() + patience
        for memory in self._memories.values():
            if memory.problem:
                memory.keep()
        phase = self._members.column('phase', np.int64, estimate=True)
        self._kept &= ~np.isin(phase, LEARNING)
        learned = np.flatnonzero((phase == PHASE_MONITOR) & ~self._kept).tolist()
        for number in (*learned, *self._unsaved):
            if time.monotonic() > end:
                break
            self._kept[number] = True
            if self._members.all[number].reference:
                done, text = self.save(number)
                (self._node.get_logger().info if done else self._node.get_logger().error)(text)

    def save(self, number: int) -> tuple[bool, str]:
        """
        Save what was learned of a valve.

        :param number: of the valve.
        :return: whether it was done, and a sentence.
        """
        member = self._members.all[number]
        if member.reference is None:
            return False, f'{member.namespace}: it has no setting reference'
        bank, place = self._members.at(number)
        try:
            content = Reference(
                member.actuator,
                bank.learned(place),
                member.settings.to_dict(),
                source='live',
                last_stamp=int(bank.estimates[place]['stamp']),
            )
            file = save_reference(member.reference, content)
        except ValueError as problem:
            return False, f'{member.namespace}: reference not saved: {problem}'
        except OSError as problem:
            text = f'{member.namespace}: reference not saved: {problem}'
            self._unsaved[number] = text
            return False, text
        self._unsaved.pop(number, None)
        return True, f'{member.namespace}: reference saved: {file}'

    def load(self, number: int) -> tuple[bool, str]:
        """
        Take up what was learned of a valve.

        :param number: of the valve.
        :return: whether it was done, and a sentence.
        """
        return self._load(number, quiet=False)

    def _load(self, number: int, *, quiet: bool) -> tuple[bool, str]:
        member = self._members.all[number]
        if member.reference is None:
            return False, f'{member.namespace}: it has no setting reference'
        bank, place = self._members.at(number)
        try:
            kept = load_reference(member.reference, member.actuator, member.settings)
            bank.restore(place, kept.learned)
        except NoReferenceError as problem:
            return False, f'{member.namespace}: {problem}'
        except ValueError as problem:
            text = f'{member.namespace}: reference refused, the valve is learned: {problem}'
            if quiet:
                self._node.get_logger().warning(text)
            return False, text
        self._kept[number] = True
        return True, f'{member.namespace}: reference loaded'

    def detector(self, number: int) -> Detector:
        """
        Return the detector of a valve.

        :param number: of the valve.
        :return: it works on the bank's state.
        """
        bank, place = self._members.at(number)
        return bank.detector(place)

    def _memory(self, number: int) -> AlarmMemory:
        if number not in self._memories:
            path = self._folder / f'{self._file(number)}.alarm' if self._folder else None
            self._memories[number] = AlarmMemory(self._node, self.detector(number), path)
        return self._memories[number]

    def _file(self, number: int) -> str:
        return self._members.all[number].file

    def _of(self, number: int) -> set[str]:
        stem = self._file(number)
        return {f'{stem}.alarm.a.json', f'{stem}.alarm.b.json', f'{stem}.alarm.json'}

    def _names(self) -> list[str]:
        if self._folder is None or not self._folder.is_dir():
            return []
        return [path.name for path in self._folder.iterdir()]


class Operated(NamedTuple):
    """Hold what people need who act on the valves of a fleet."""

    entities: Entities  # of the fleet's node, by which they are served
    actions: OperatorActions  # the record of what they do
    members: Members
    keeping: Keeping
