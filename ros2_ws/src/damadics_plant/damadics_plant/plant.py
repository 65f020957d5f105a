# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `plant`: the simulated actuator, publishing its signals at the sample rate."""

import sys
import time
from typing import Any

import rclpy
from damadics_fd.ros import qos
from damadics_fd.ros.parameters import Parameters
from damadics_fd.ros.spin import spin
from damadics_msgs.msg import FaultState, Measurement
from damadics_msgs.srv import InjectFault
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage

from damadics_plant import Simulator

MODELS = ('dablib', 'lugre')
TICK = 0.002  # s of wall time between two looks at what is due
LARGEST_BURST = 200  # samples of one tick: the executor must come to its other work
SETTLE = 0.5  # s from the last awaited subscriber to the first sample, for the other topics
PATIENCE = 0.5  # s of wall time behind which the pace is given up


class Plant(Node):
    """Play a scenario against the wall clock; stamps count from the scenario's start."""

    def __init__(self) -> None:
        super().__init__('plant')
        self.finished = False
        self.exit_code = 0
        parameters = Parameters(self)
        declare = parameters.declare
        scenario = declare('scenario', 'nominal', 'name of a scenario, or path of its YAML file')
        rate = declare(
            'rate', 400.0, 'samples per second of scenario time [Hz]', limits=(1.0, 1000.0)
        )
        model = declare('model', 'dablib', 'model of the actuator', allowed=MODELS)
        noise = declare('noise', False, 'add the noise of the benchmark')
        seed = declare('seed', 0, 'seed of the noise and of random inputs', limits=(0, 2**31 - 1))
        self._factor = declare(
            'real_time_factor', 1.0,
            'seconds of scenario per second of wall time [1]; 0: as fast as it goes',
            limits=(0.0, 1000.0),
        )
        self._awaited = declare(
            'wait_for_subscribers', 0,
            'number of subscribers on measurement before the first sample', limits=(0, 100),
        )
        self._frame_id = declare('actuator', 'LC74_20', 'tag of the actuator')
        duration = declare(
            'duration', 0.0, 'time that is simulated [s]; 0: that of the scenario',
            limits=(0.0, 1e9),
        )
        publish_clock = declare('publish_clock', False, 'publish /clock from scenario time')
        parameters.check()
        try:
            self._simulator = Simulator(scenario, rate=rate, model=model, noise=noise, seed=seed,
                                        duration=duration or None)
        except ValueError as problem:
            parameters.check(f'scenario: {problem}')
        self._measurement = self.create_publisher(Measurement, 'measurement', qos.SAMPLES)
        self._fault_state = self.create_publisher(FaultState, 'fault_state', qos.SAMPLES)
        self.create_service(InjectFault, 'inject_fault', self._inject)
        self._clock_topic = None
        if publish_clock:
            self._clock_topic = self.create_publisher(ClockMessage, '/clock', 10)
        self._rate = rate
        self._sent = 0
        self._began = 0.0
        self.create_timer(TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(
            f'{scenario}, model {model}, {rate:g} Hz, real-time factor {self._factor:g}'
        )

    def _tick(self) -> None:
        """Publish what has become due."""
        if self.finished:
            return
        now = time.monotonic()
        if not self._began:
            if self._measurement.get_subscription_count() < self._awaited:
                return
            self._began = now + (SETTLE if self._awaited else 0.0)
        if now < self._began:
            return
        due = LARGEST_BURST
        if self._factor:
            due = int((now - self._began) * self._factor * self._rate) + 1 - self._sent
            behind = (due - LARGEST_BURST) / (self._factor * self._rate)
            if behind > PATIENCE:
                self._began += behind
                self.get_logger().warning(
                    f'this machine does not reach real-time factor {self._factor:g}: '
                    f'{behind:.1f} s behind', throttle_duration_sec=5.0,
                )
        if due > 0:
            self._publish(min(due, LARGEST_BURST))
        if self._simulator.finished:
            self.get_logger().info(f'scenario ended after {self._sent} samples')
            self.finished = True

    def _inject(self, request: Any, response: Any) -> Any:
        """Begin a fault with the next sample, or clear all."""
        try:
            if request.fault == FaultState.NONE:
                self._simulator.clear()
                response.message = 'all faults cleared'
            else:
                self._simulator.inject(f'f{request.fault}', request.strength, request.development)
                response.message = f'fault f{request.fault} injected'
            response.success = True
        except ValueError as problem:
            response.message = f'not injected: {problem}'
        self.get_logger().info(response.message)
        return response

    def _publish(self, count: int) -> None:
        columns = self._simulator.advance(count)
        names = ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
        signals = [columns[name].tolist() for name in names]
        truth = zip(columns['fault'].tolist(), columns['strength'].tolist(), strict=True)
        measurement, fault_state = Measurement(), FaultState()
        measurement.header.frame_id = fault_state.header.frame_id = self._frame_id
        for stamp, values, (fault, strength) in zip(
            columns['stamp'].tolist(), zip(*signals, strict=True), truth, strict=True
        ):
            for header in (measurement.header, fault_state.header):
                header.stamp.sec, header.stamp.nanosec = divmod(stamp, 1_000_000_000)
            for name, value in zip(names, values, strict=True):
                setattr(measurement, name, value)
            fault_state.fault, fault_state.strength = fault, strength
            if self._clock_topic:
                self._clock_topic.publish(ClockMessage(clock=measurement.header.stamp))
            self._fault_state.publish(fault_state)
            self._measurement.publish(measurement)
        self._sent += len(signals[0])

    def destroy_node(self) -> None:
        """Let subscribers take the end of a scenario, then go."""
        if self.finished:
            self._measurement.wait_for_all_acked(rclpy.duration.Duration(seconds=2.0))
        super().destroy_node()


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return spin(Plant, args)


if __name__ == '__main__':
    sys.exit(main())
