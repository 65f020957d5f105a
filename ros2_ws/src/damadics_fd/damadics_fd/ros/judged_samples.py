# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a detector publishes of each sample, while somebody listens: `residual` and `threshold`."""

from damadics_msgs.msg import Float64Stamped

from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.decision.events import Decision
from damadics_fd.ros import qos
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.raw import Encoder


class JudgedSamples:
    """
    Publishers of `residual` and `threshold`.

    :param entities: of the node.
    :param core: the detector.
    """

    def __init__(self, entities: Entities, core: Detector) -> None:
        self._core = core
        self._encode = Encoder()
        made = entities.publisher_on_request
        self._residual, self._residual_heard = made(Float64Stamped, 'residual', qos.SAMPLES)
        self._threshold, self._threshold_heard = made(Float64Stamped, 'threshold', qos.SAMPLES)
        self._wanted = False, False  # residual, threshold

    @property
    def heard(self) -> bool:
        """Whether somebody listens to any of them; `publish` goes by the latest answer."""
        self._wanted = self._residual_heard.count > 0, self._threshold_heard.count > 0
        return any(self._wanted)

    def say(self, tag: str) -> None:
        """
        Publish what is heard of the latest decision.

        :param tag: of the actuator.
        """
        self.publish(self._core.decision, tag)

    def publish(self, decision: Decision, tag: str) -> None:
        """
        Publish what is heard.

        :param decision: on a sample.
        :param tag: of the actuator.
        """
        residual, threshold = self._wanted
        if residual:
            self._residual(self._encode(decision.stamp, tag, decision.residual))
        if threshold:
            self._threshold(self._encode(decision.stamp, tag, decision.threshold))
