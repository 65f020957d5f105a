# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Signatures and trends of the valves of a fleet: kept, and published for exposed valves."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from rclpy.node import Node

from damadics_fd.core.record import Ints
from damadics_fd.nodes.fleet.members import Members, first_stamps
from damadics_fd.nodes.signature_publisher import SignaturePublisher
from damadics_fd.ros.entities import Entities

MONITOR = 'monitor'  # the mode that has a signature


class Signatures:
    """
    Keep the signatures and trends of a fleet, each as the detector of one valve does.

    A valve that has no news and no topic of its own costs nothing.

    :param node: the fleet's node.
    :param entities: of the node.
    :param members: the valves.
    :param folder: with a folder for each valve; None where nothing is kept.
    :param limits: of the trends, per quantity.
    """

    def __init__(
        self,
        node: Node,
        entities: Entities,
        members: Members,
        folder: Path | None,
        limits: Mapping[str, Sequence[float]],
    ) -> None:
        self._node = node
        self._entities = entities
        self._members = members
        self._folder = folder
        self._limits = limits
        self._publishers: dict[int, SignaturePublisher] = {}
        self._exposed: list[int] = []
        self._pending: set[int] = set()  # of before, not yet compared with a stamp
        self._seen = np.zeros(len(members), np.int64)  # instant of the newest change [ns]

    @property
    def problems(self) -> list[str]:
        """What is not kept."""
        return [one.problem for one in self._publishers.values() if one.problem]

    def restore(self, exposed: Iterable[int]) -> None:
        """
        Take up what was kept.

        :param exposed: valves with topics of their own.
        """
        self._exposed = [n for n in exposed if self._members.at(n)[0].mode == MONITOR]
        for number in self._exposed:
            self._publisher(number)
        kept = self._folder is not None and self._folder.is_dir()
        names = {path.name for path in self._folder.iterdir()} if self._folder and kept else set()
        for number, member in enumerate(self._members.all):
            if member.settings.mode == MONITOR and member.file in names:
                self._publisher(number).restore()
                self._pending.add(number)

    def begin(self, valve: Ints, stamp: Ints) -> None:
        """
        Compare signatures of before with the first stamps after the start.

        :param valve: of rows that are about to be judged.
        :param stamp: of these rows [ns].
        """
        if not self._pending:
            return
        for number, first in first_stamps(self._pending, valve, stamp):
            self._publisher(number).begin(first)

    def update(self) -> None:
        """Keep and publish what is new."""
        instant = np.zeros(len(self._members), np.int64)
        for bank, numbers in zip(self._members.banks, self._members.numbers, strict=True):
            if bank.mode == MONITOR:
                instant[numbers] = bank.signatures['now_t'] + bank.signatures['verified']
        news = np.flatnonzero(instant != self._seen).tolist() if self._folder else []
        self._seen = instant
        for number in dict.fromkeys([*self._exposed, *news]):
            bank, place = self._members.at(number)
            stamp = int(bank.decisions[place]['stamp'])
            if stamp:
                self._publisher(number).update(stamp, self._members.all[number].actuator)

    def _publisher(self, number: int) -> SignaturePublisher:
        if number not in self._publishers:
            member = self._members.all[number]
            bank, place = self._members.at(number)
            self._publishers[number] = SignaturePublisher(
                self._node,
                self._entities,
                bank.detector(place).signature,
                member.actuator,
                member.settings,
                self._folder / member.file if self._folder else None,
                self._limits,
                f'{member.namespace}/signature' if number in self._exposed else None,
            )
        return self._publishers[number]
