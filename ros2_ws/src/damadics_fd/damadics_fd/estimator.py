# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `estimator`: velocity and on-line approximator of one actuator."""

import sys

from damadics_msgs.msg import Estimate as EstimateMessage
from damadics_msgs.msg import Measurement
from rclpy.node import Node

from damadics_fd.core.estimator import Estimator
from damadics_fd.core.quality import EXPLANATIONS
from damadics_fd.ros import qos
from damadics_fd.ros.conversions import sample, write_estimate
from damadics_fd.ros.diagnostics import Diagnostics, Level, Report
from damadics_fd.ros.parameters import Parameters, declare_settings
from damadics_fd.ros.spin import spin
from damadics_fd.ros.waiting import InputWatch

START_PLANT = 'start a driver of the valve, or the simulator: ros2 run damadics_plant plant'
READY = (1, 0.5, 0.5, 0.0, 0.0, 20.0, 0.0, 0.0)  # a sample that makes the core compile


class EstimatorNode(Node):
    """Turn each measurement into an estimate; report what was refused."""

    def __init__(self) -> None:
        super().__init__('estimator')
        self.finished = False
        parameters = Parameters(self)
        actuator = parameters.declare('actuator', '', 'tag of the actuator, for diagnostics')
        timeout = parameters.declare(
            'input_timeout', 0.5, 'silence after which the input counts as lost [s]',
            limits=(0.01, 3600.0),
        )
        settings = declare_settings(parameters)
        Estimator(settings).update(*READY)
        self._core = Estimator(settings)
        self._message = EstimateMessage()
        self._publisher = self.create_publisher(
            EstimateMessage, 'estimate', qos.samples(settings.sample_rate)
        )
        self._watch = InputWatch(self, 'measurement', START_PLANT, timeout)
        self._diagnostics = Diagnostics(self, actuator or 'actuator', self._report)
        self._refused_before = 0
        self.create_subscription(
            Measurement, 'measurement', self._take, qos.samples(settings.sample_rate)
        )
        self.get_logger().info(f'mode {settings.mode}, {settings.sample_rate:g} Hz')

    def _take(self, measurement: Measurement) -> None:
        self._watch.arrived()
        estimate = self._core.update(*sample(measurement))
        if estimate is None:
            self._diagnostics.check()
            return
        write_estimate(estimate, self._message)
        self._message.header.frame_id = measurement.header.frame_id
        self._publisher.publish(self._message)

    def _report(self) -> Report:
        counters = self._core.counters
        refused = sum(counters[reason] for reason in EXPLANATIONS)
        values = {
            'Mode': self._core.settings.mode,
            'Phase': self._core.phase,
            'Last refused': self._core.last_rejection or 'none',
            **{f'Samples {name.replace("_", " ")}': count for name, count in counters.items()},
        }
        if self._watch.silent:
            return Level.ERROR, 'no measurement arrives', values
        if refused > self._refused_before:
            self._refused_before = refused
            reason = self._core.last_rejection.split(':')[0]
            return Level.WARN, f'samples refused: {EXPLANATIONS.get(reason, reason)}', values
        return Level.OK, f'phase {self._core.phase}', values


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return spin(EstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
