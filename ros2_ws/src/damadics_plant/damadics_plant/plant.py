# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `plant`: the simulated actuator, publishing its signals at the sample rate."""

import sys
import time
from collections import deque

from builtin_interfaces.msg import Time
from damadics_fd.bag.cdr.layout import stamped_encoder
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.ros import qos
from damadics_fd.ros.arguments import check_node_arguments
from damadics_fd.ros.parameters import Parameters
from damadics_fd.ros.spin import SpinnableNode, spin
from damadics_msgs.msg import FaultState, Measurement, StrokeRequest
from damadics_msgs.srv import InjectFault
from rclpy.clock import Clock, ClockType
from rosgraph_msgs.msg import Clock as ClockMessage

from damadics_plant import Simulator
from damadics_plant.actuator.twin import ENTRY, OPERATION, origin, parts_of, twin_of

DESCRIPTION = 'Simulate the actuator and publish its signals and its faults at the sample rate.'
EXAMPLES = """examples:
  ros2 run damadics_plant plant
  ros2 run damadics_plant plant --ros-args -p scenario:=paper_friction -p real_time_factor:=10.0
  ros2 run damadics_plant plant --ros-args -p model:=lugre -p rate:=200.0 -p noise:=true
  ros2 run damadics_plant simulate --list        all scenarios"""
MODELS = ('dablib', 'lugre')
TICKS = (0.002, 0.01)  # s of wall time between two looks at what is due: least, greatest
LEAD = 0.25  # ticks that a sample is due before the look that sends it: none waits for the next
LARGEST_BURST = 200  # samples of one tick: the executor must come to its other work
SETTLE = 0.5  # s from the last awaited subscriber to the first sample, for the other topics
AHEAD = 0.05  # s of wall time that is simulated at once; an injected fault begins after it
MESSAGES = {
    'damadics_msgs/msg/FaultState': ('fault', 'strength'),
    'damadics_msgs/msg/Measurement': SIGNALS,
}
SETTINGS = tuple(entry['name'] for entry in Settings.describe())  # of monitors
PATIENCE = 0.5  # s of wall time behind which the pace is given up


class Plant(SpinnableNode):
    """Play a scenario against the wall clock; stamps count from the scenario's start."""

    def __init__(self) -> None:
        super().__init__('plant')
        self.finished = False
        self.exit_code = 0
        parameters = Parameters(self)
        declare = parameters.declare
        scenario = declare('scenario', 'nominal', 'name of a scenario, or path of its YAML file')
        valve = declare('valve', '', 'file of a valve, written by commission; for model')
        twin, problems = parameters.take(ENTRY), []
        try:
            twin = parts_of(valve)[ENTRY] if valve else twin
        except ValueError as error:
            problems.append(f'valve: {error}')
        of = origin(twin)
        rate = declare(
            'rate',
            of.sample_rate or 400.0,
            'samples per second of scenario time [Hz]',
            limits=(1.0, 1000.0),
        )
        model = declare('model', 'dablib', 'model of the actuator', allowed=MODELS)
        noise = declare('noise', False, 'add the noise of the benchmark')
        seed = declare('seed', 0, 'seed of the noise and of random inputs', limits=(0, 2**31 - 1))
        self._factor = declare(
            'real_time_factor',
            1.0,
            'seconds of scenario per second of wall time [1]; 0: as fast as it goes',
            limits=(0.0, 1000.0),
        )
        self._awaited = declare(
            'wait_for_subscribers',
            0,
            'number of subscribers on measurement before the first sample',
            limits=(0, 100),
        )
        self._frame_id = declare('actuator', of.actuator or 'LC74_20', 'tag of the actuator')
        duration = declare(
            'duration',
            0.0,
            'time that is simulated [s]; 0: that of the scenario',
            limits=(0.0, 1e9),
        )
        publish_clock = declare('publish_clock', False, 'publish /clock from scenario time')
        parameters.take(OPERATION)  # of the same file; the scenario has its own pressures
        others = parameters.pass_over(SETTINGS)
        parameters.check(*problems)
        try:
            self._simulator = Simulator(
                scenario,
                rate=rate,
                model=twin_of(twin, valve or ENTRY) if twin else model,
                noise=noise,
                seed=seed,
                duration=duration or None,
            )
        except ValueError as error:
            parameters.check(f'{"valve" if twin else "scenario"}: {error}')
        self._measurement = self.create_publisher(Measurement, 'measurement', qos.SAMPLES)
        self._fault_state = self.create_publisher(FaultState, 'fault_state', qos.SAMPLES)
        self.create_service(InjectFault, 'inject_fault', self._inject)
        self.create_subscription(StrokeRequest, 'stroke_request', self._stroke, qos.COMMANDS)
        self._clock_topic = None
        if publish_clock:
            self._clock_topic = self.create_publisher(ClockMessage, '/clock', 10)
        self._rate = rate
        self._sent = 0
        self._began = 0.0
        pace = rate * self._factor  # samples per second of wall time
        self._tick_length = min(max(TICKS[0], 1.0 / pace), TICKS[1]) if pace else TICKS[0]
        self._block = min(max(1, int(pace * AHEAD)), LARGEST_BURST)
        self._ahead: deque[tuple[int, bytes, bytes]] = deque()
        self._simulate(self._block)  # before the clock runs: the first block loads compiled code
        self.create_timer(
            self._tick_length, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        played = f'valve {valve or of.actuator}' if twin else f'model {model}'
        self.get_logger().info(
            f'{scenario}, {played}, {rate:g} Hz, real-time factor {self._factor:g}'
        )
        if others and not twin:
            self.get_logger().warning(
                f'{", ".join(others)}: for monitors, not for the plant; it simulates the valve of '
                'a file with -p valve:=FILE'
            )

    def _tick(self) -> None:
        """Publish what has become due."""
        if self.finished:
            return
        now = time.monotonic()
        if not self._began:
            if self._measurement.get_subscription_count() < self._awaited:
                return
            settle = round(SETTLE / self._tick_length) if self._awaited else 0
            self._began = now + (settle - LEAD) * self._tick_length
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
                    f'{behind:.1f} s behind',
                    throttle_duration_sec=5.0,
                )
        if due > 0:
            self._publish(min(due, LARGEST_BURST))
        if self._simulator.finished and not self._ahead:
            self.get_logger().info(f'scenario ended after {self._sent} samples')
            self.finished = True

    def _inject(
        self, request: InjectFault.Request, response: InjectFault.Response
    ) -> InjectFault.Response:
        """Begin a fault with the next sample that is not yet simulated, or clear all."""
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

    def _stroke(self, request: StrokeRequest) -> None:
        """Make partial strokes from the next sample on that is not yet simulated, or end them."""
        try:
            self._simulator.stroke(request.amplitude, request.count)
        except ValueError as problem:
            self.get_logger().warning(f'no partial strokes: {problem}')

    def _publish(self, count: int) -> None:
        """Publish the next samples, then the time that they have brought."""
        stamp = -1
        for _ in range(count):
            if not self._ahead:
                if self._simulator.finished:
                    break
                self._simulate(max(count, self._block))
            stamp, fault_state, measurement = self._ahead.popleft()
            self._fault_state.publish(fault_state)
            self._measurement.publish(measurement)
            self._sent += 1
        if self._clock_topic and stamp >= 0:
            sec, nanosec = divmod(stamp, 1_000_000_000)
            self._clock_topic.publish(ClockMessage(clock=Time(sec=sec, nanosec=nanosec)))

    def _simulate(self, count: int) -> None:
        """Have the next samples ready, serialised: many at once cost little more than one."""
        columns = self._simulator.advance(count)
        stamp = columns['stamp']
        rows = [
            stamped_encoder(kind, self._frame_id)({name: columns[name] for name in names}, stamp)
            for kind, names in MESSAGES.items()
        ]
        self._ahead.extend(zip(stamp.tolist(), *(map(bytes, row) for row in rows), strict=True))


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    check_node_arguments('plant', DESCRIPTION, EXAMPLES, args)
    return spin(Plant, args)


if __name__ == '__main__':
    sys.exit(main())
