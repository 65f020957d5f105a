# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `detector`: residual against threshold, fault flag and events of one actuator."""

import sys

from damadics_msgs.msg import Estimate as EstimateMessage
from damadics_msgs.msg import FaultEvent, FaultFlag, Float64Stamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from damadics_fd.core.alarm import NE107
from damadics_fd.core.detector import Decision, Detector
from damadics_fd.core.estimator import Estimate
from damadics_fd.ros import qos
from damadics_fd.ros.conversions import event_message, read_estimate, write_flag
from damadics_fd.ros.diagnostics import Diagnostics, Level, Report
from damadics_fd.ros.parameters import Parameters, declare_settings
from damadics_fd.ros.spin import spin
from damadics_fd.ros.waiting import InputWatch

HEARTBEAT = 1.0  # s of wall time
START_ESTIMATOR = 'start the estimator: ros2 run damadics_fd estimator'
READY = Estimate._make([1] + [0.0] * 14 + [0])  # an estimate that makes the core compile


class DetectorNode(Node):
    """Judge each estimate; publish residual, threshold and what changes."""

    def __init__(self) -> None:
        super().__init__('detector')
        self.finished = False
        parameters = Parameters(self)
        actuator = parameters.declare('actuator', '', 'tag of the actuator, for diagnostics')
        timeout = parameters.declare(
            'input_timeout', 0.5, 'silence after which the valve is not monitored [s]',
            limits=(0.01, 3600.0),
        )
        settings = declare_settings(parameters)
        Detector(settings).update(READY)
        self._core = Detector(settings)
        self._decision: Decision | None = None
        self._number = Float64Stamped()
        self._flag = FaultFlag()
        samples = qos.samples(settings.sample_rate)
        self._residual = self.create_publisher(Float64Stamped, 'residual', samples)
        self._threshold = self.create_publisher(Float64Stamped, 'threshold', samples)
        self._fault_flag = self.create_publisher(FaultFlag, 'fault_flag', qos.FLAG)
        self._fault_event = self.create_publisher(FaultEvent, 'fault_event', qos.EVENTS)
        self._watch = InputWatch(self, 'estimate', START_ESTIMATOR, timeout)
        self._diagnostics = Diagnostics(self, actuator or 'actuator', self._report)
        self._was_silent = True
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(min(timeout / 5.0, HEARTBEAT), self._look, clock=steady)
        self.create_timer(HEARTBEAT, self._publish_flag, clock=steady)
        self.create_subscription(EstimateMessage, 'estimate', self._take, samples)
        self._publish_flag()
        self.get_logger().info(f'mode {settings.mode}, {settings.sample_rate:g} Hz')

    def _take(self, message: EstimateMessage) -> None:
        self._watch.arrived()
        decision = self._core.update(read_estimate(message))
        header = message.header
        self._number.header = self._flag.header = header
        self._number.data = decision.residual
        self._residual.publish(self._number)
        self._number.data = decision.threshold
        self._threshold.publish(self._number)
        before, self._decision = self._decision, decision
        if before is None or self._was_silent or decision[5:8] != before[5:8]:
            self._was_silent = False
            self._publish_flag()
            self._diagnostics.check()
        for event in decision.events:
            self._fault_event.publish(event_message(event, header.frame_id))

    def _look(self) -> None:
        """Turn to "not monitoring" when the input falls silent."""
        if self._watch.silent and not self._was_silent:
            self._was_silent = True
            self._publish_flag()
            self._diagnostics.check()

    def _publish_flag(self) -> None:
        if self._decision is not None:
            write_flag(self._decision, self._flag)
        if self._watch.silent:
            self._flag.state = FaultFlag.STATE_NOT_MONITORING
        self._fault_flag.publish(self._flag)

    def _report(self) -> Report:
        decision = self._decision
        if decision is None:
            return Level.ERROR, 'no estimate has arrived', {'Mode': self._core.settings.mode}
        values = {
            'Mode': self._core.settings.mode,
            'Fault': decision.fault,
            'Residual (1/s)': decision.residual,
            'Threshold (1/s)': decision.threshold,
            'Faults since the start': decision.occurrence,
            'NE 107': NE107[decision.level],
        }
        if self._watch.silent:
            return Level.ERROR, 'estimates have stopped: not monitoring', values
        if decision.fault:
            return Level.ERROR, f'fault {decision.occurrence} flagged', values
        return Level.OK, 'no fault flagged', values


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return spin(DetectorNode, args)


if __name__ == '__main__':
    sys.exit(main())
