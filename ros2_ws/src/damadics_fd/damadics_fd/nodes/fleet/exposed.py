# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Topics of single valves of a fleet: their measurement in, their judgements out."""

from collections.abc import Callable

from damadics_msgs.msg import Estimate as EstimateMessage
from damadics_msgs.msg import FaultEvent, FaultFlag, Float64Stamped, Isolation, Measurement

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.events import Decision
from damadics_fd.nodes.fleet.members import Member
from damadics_fd.ros import qos
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.raw import Encoder, EstimateEncoder


class Exposed:
    """
    The topics of one valve; each sample is published only while somebody listens.

    :param entities: of the fleet's node.
    :param number: of the valve.
    :param member: the valve.
    :param take: called with its number and each serialised measurement.
    """

    def __init__(
        self,
        entities: Entities,
        number: int,
        member: Member,
        take: Callable[[int, bytes], None],
    ) -> None:
        self._tag = member.actuator
        self._encode, self._encoder = Encoder(), EstimateEncoder()
        place = member.namespace

        def taken(data: bytes) -> None:
            take(number, bytes(data))

        entities.subscription(Measurement, member.measurement, taken, qos.SAMPLES, raw=True)
        self.flag = entities.publisher(FaultFlag, f'{place}/fault_flag', qos.FLAG)
        self.event = entities.publisher(FaultEvent, f'{place}/fault_event', qos.EVENTS)
        self.isolation = entities.publisher(Isolation, f'{place}/isolation', qos.FLAG)
        self._estimate = entities.publisher(EstimateMessage, f'{place}/estimate', qos.SAMPLES)
        self._residual = entities.publisher(Float64Stamped, f'{place}/residual', qos.SAMPLES)
        self._threshold = entities.publisher(Float64Stamped, f'{place}/threshold', qos.SAMPLES)

    @property
    def watched(self) -> bool:
        """Whether somebody listens to its samples."""
        topics = (self._estimate, self._residual, self._threshold)
        return any(topic.get_subscription_count() for topic in topics)

    def sample(self, estimate: Estimate, decision: Decision) -> None:
        """
        Publish what became of a sample.

        :param estimate: of the sample.
        :param decision: on it.
        """
        self._estimate.publish(self._encoder.encode(estimate, self._tag))
        stamp, tag = decision.stamp, self._tag
        self._residual.publish(self._encode(stamp, tag, decision.residual))
        self._threshold.publish(self._encode(stamp, tag, decision.threshold))
