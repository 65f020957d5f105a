# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What several nodes of a process share, one of them keeping it for all."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Generic, NamedTuple, TypeVar

from rclpy.node import Node

Part = TypeVar('Part')


class Member(NamedTuple, Generic[Part]):
    """A node that takes part."""

    node: Node
    part: Part


class Shared(ABC, Generic[Part]):
    """Something that the first of some nodes makes; when it leaves, the next makes it anew."""

    def __init__(self) -> None:
        self._members: list[Member[Part]] = []

    @abstractmethod
    def _make(self, keeper: Node) -> None:
        """Make what is shared, of a node."""

    @abstractmethod
    def _release(self, keeper: Node) -> None:
        """Release it, while its node is still there."""

    def join(self, node: Node, part: Part) -> Callable[[], None]:
        """
        Take part.

        :param node: that does.
        :param part: of it.
        :return: ends that; the others go on.
        """
        member = Member(node, part)
        self._members.append(member)
        if len(self._members) == 1:
            self._make(node)
        return lambda: self._leave(member)

    def _leave(self, member: Member[Part]) -> None:
        kept = self._members[0] is member
        self._members = [other for other in self._members if other is not member]
        if kept:
            self._release(member.node)
            if self._members:
                self._make(self._members[0].node)
