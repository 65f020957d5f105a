# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hand the state of valves over from a process that ends to one that goes on with them."""

import base64
import zlib
from pathlib import Path

from rclpy.node import Node

from damadics_fd.core.record import Plain
from damadics_fd.nodes.fleet.members import Members
from damadics_fd.store.alarms import AlarmStore, LostAlarmError
from damadics_fd.store.slots import read_slots, write_slot

FORMAT = 'damadics_fd valve state 1'
LARGEST = 4_000_000  # bytes; the state of a valve of any mode is far smaller


class Handover:
    """
    Give and take the whole state of valves: nothing is learned anew, no alarm lost or told twice.

    A state is taken once; after a crash there is none, and alarms and references are what is left.

    :param node: the fleet's node.
    :param members: the valves.
    :param folder: of the states; None where none are handed over.
    :param alarms: folder of the alarms, which may be newer than a state.
    """

    def __init__(
        self, node: Node, members: Members, folder: Path | None, alarms: Path | None
    ) -> None:
        self._node = node
        self._members = members
        self._folder = folder
        self._alarms = alarms

    def take(self) -> set[int]:
        """
        Go on with the states that another process left.

        :return: numbers of the valves that have one.
        """
        taken: set[int] = set()
        if self._folder is None:
            return taken
        for number, member in enumerate(self._members.all):
            slots = read_slots(self._folder / f'{member.file}.state', FORMAT)
            if not slots:
                continue
            try:
                if slots[0].content is None:
                    raise ValueError(slots[0].problem)
                self._restore(number, slots[0].content)
            except (ValueError, KeyError, TypeError, zlib.error) as problem:
                self._node.get_logger().warning(
                    f'{member.namespace}: state not taken up, alarm and reference are: {problem}'
                )
            else:
                taken.add(number)
            for slot in slots:
                slot.file.unlink(missing_ok=True)
        if taken:
            self._node.get_logger().info(f'{len(taken)} valves go on where they were left')
        return taken

    def give(self) -> None:
        """Leave the states to another process."""
        if self._folder is None:
            return
        for number, member in enumerate(self._members.all):
            bank, place = self._members.at(number)
            stamp = int(bank.estimates[place]['stamp'])
            if not stamp:
                continue
            state = base64.b64encode(zlib.compress(bank.tobytes(place), 1)).decode()
            content: dict[str, Plain] = {
                'actuator': member.actuator,
                'settings': member.settings.to_dict(),
                'stamp': stamp,
                'state': state,
            }
            try:
                write_slot(self._folder / f'{member.file}.state', FORMAT, content)
            except OSError as problem:
                self._node.get_logger().error(
                    f'{member.namespace}: state not handed over: {problem}'
                )

    def _restore(self, number: int, content: dict[str, Plain]) -> None:
        member = self._members.all[number]
        if content['actuator'] != member.actuator:
            raise ValueError(f'it is of {content["actuator"]}, not {member.actuator}')
        if content['settings'] != member.settings.to_dict():
            raise ValueError('its settings differ')
        if self._newer_alarm(number, int(str(content['stamp']))):
            raise ValueError('the alarm was kept after it')
        unpacking = zlib.decompressobj()
        state = unpacking.decompress(
            base64.b64decode(str(content['state']), validate=True), LARGEST
        )
        bank, place = self._members.at(number)
        bank.restore_bytes(place, state)

    def _newer_alarm(self, number: int, stamp: int) -> bool:
        """Tell whether the alarm on disk is of a later sample than a state."""
        if self._alarms is None:
            return False
        try:
            kept = AlarmStore(self._alarms / f'{self._members.all[number].file}.alarm').load()
        except LostAlarmError:
            return False
        return kept is not None and int(str(kept.state.get('stamp', 0))) > stamp
