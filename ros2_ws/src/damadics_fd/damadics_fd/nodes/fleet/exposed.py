# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Topics of single valves of a fleet: their measurement in, their flag and events out."""

from collections.abc import Callable
from typing import NamedTuple

from damadics_msgs.msg import FaultEvent, FaultFlag, Measurement
from rclpy.publisher import Publisher

from damadics_fd.nodes.fleet.members import Member
from damadics_fd.ros import qos
from damadics_fd.ros.entities import Entities


class Exposed(NamedTuple):
    """Hold the publishers of one valve."""

    flag: Publisher
    event: Publisher


def expose(
    entities: Entities, number: int, member: Member, take: Callable[[int, bytes], None]
) -> Exposed:
    """
    Give a valve topics of its own.

    :param entities: of the fleet's node.
    :param number: of the valve.
    :param member: the valve.
    :param take: called with its number and each serialised measurement.
    :return: its publishers.
    """

    def taken(data: bytes) -> None:
        take(number, bytes(data))

    entities.subscription(
        Measurement,
        member.measurement,
        taken,
        qos.SAMPLES,
        raw=True,
    )
    return Exposed(
        entities.publisher(FaultFlag, f'{member.namespace}/fault_flag', qos.FLAG),
        entities.publisher(FaultEvent, f'{member.namespace}/fault_event', qos.EVENTS),
    )
