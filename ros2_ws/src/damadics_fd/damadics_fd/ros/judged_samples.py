# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a detector publishes of each sample, while somebody listens: `residual` and `threshold`."""

from damadics_msgs.msg import Float64Stamped

from damadics_fd.core.decision.events import Decision
from damadics_fd.ros import qos
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.raw import Encoder


class JudgedSamples:
    """
    Publishers of `residual` and `threshold`.

    :param entities: of the node.
    """

    def __init__(self, entities: Entities) -> None:
        self._encode = Encoder()
        made = entities.publisher_on_request
        self._residual, self._residual_heard = made(Float64Stamped, 'residual', qos.SAMPLES)
        self._threshold, self._threshold_heard = made(Float64Stamped, 'threshold', qos.SAMPLES)

    @property
    def heard(self) -> bool:
        """Whether somebody listens to any of them."""
        return bool(self._residual_heard.count or self._threshold_heard.count)

    def publish(self, decision: Decision, tag: str) -> None:
        """
        Publish what is heard.

        :param decision: on a sample.
        :param tag: of the actuator.
        """
        if self._residual_heard.count:
            self._residual.publish(self._encode(decision.stamp, tag, decision.residual))
        if self._threshold_heard.count:
            self._threshold.publish(self._encode(decision.stamp, tag, decision.threshold))
