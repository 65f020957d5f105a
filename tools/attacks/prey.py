# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The nodes that are attacked."""

import json
import math
import random
import subprocess
import time
from collections import Counter
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_prefix
from damadics_fd.core.sample import SIGNALS
from damadics_msgs.msg import FaultFlag, Measurement
from damadics_plant.simulator import Simulator
from lifecycle_msgs.srv import ChangeState
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile

UNKNOWN, HEALTHY = FaultFlag.STATE_UNKNOWN, FaultFlag.STATE_HEALTHY
PERIOD = 0.01  # s between two samples
SETTINGS = {
    'paper': {'mode': 'paper', 'sample_rate': 100.0, 'latch': True, 'off_delay': 0.3, 'gw': 0.1},
    'monitor': {
        'mode': 'monitor',
        'sample_rate': 100.0,
        'latch': True,
        't_learn': 30.0,
        'verify': 10.0,
    },
}
AHEAD = 10.0  # times faster than real time, until there is an alarm in mode monitor
FAULT, STRENGTH = 'f4', 1.0
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Still:
    """A valve at rest, whose stem somebody throws."""

    def __init__(self) -> None:
        self.faulty = False

    def next(self, number: int) -> Measurement:
        """Return a sample without its stamp."""
        message = Measurement(cv=0.5, x1=0.5, p1=3.5e6, p2=2.6e6, t1=20.0, flow=5.0)
        message.ps = math.nan
        message.x1 += 0.1 * (number // 20 % 2) if self.faulty else 0.0
        return message


class Simulated:
    """A valve that works, whose friction somebody raises."""

    def __init__(self, seed: int) -> None:
        self._simulator = Simulator(
            'random_nominal', 1.0 / PERIOD, 'lugre', noise=True, seed=seed, duration=1e6
        )
        self._rows: list[tuple[float, ...]] = []
        self._faulty = False

    @property
    def faulty(self) -> bool:
        """Whether the friction is too high."""
        return self._faulty

    @faulty.setter
    def faulty(self, faulty: bool) -> None:
        if faulty and not self._faulty:
            self._simulator.inject(FAULT, STRENGTH)
        elif self._faulty and not faulty:
            self._simulator.clear()
        self._faulty = faulty

    def next(self, number: int) -> Measurement:
        """Return a sample without its stamp."""
        if not self._rows:
            columns = self._simulator.advance(20)
            rows = zip(*(columns[name].tolist() for name in SIGNALS), strict=True)
            self._rows = list(rows)[::-1]
        return Measurement(**dict(zip(SIGNALS, self._rows.pop(), strict=True)))


class Prey:
    """
    A detector and an estimator of one valve, and what they say.

    :param folder: for logs and state.
    :param seed: of everything random.
    :param mode: of the nodes.
    """

    def __init__(self, folder: Path, seed: int, mode: str) -> None:
        self.random = random.Random(seed)
        self.mode = mode
        self.valve = Simulated(seed) if mode == 'monitor' else Still()
        self.found: Counter[str] = Counter()
        self.folder = folder
        self.node = rclpy.create_node('attack')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.flags: list[FaultFlag] = []
        self.ages: list[float] = []  # of the flags' stamps when they came [s]
        self.came: list[float] = []  # when they came [s]
        self.node.create_subscription(FaultFlag, 'fault_flag', self.heed, LATCHED)
        self.samples = self.node.create_publisher(Measurement, 'measurement', 1000)
        self.zero = time.monotonic()
        self.sent = 0
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self.clients: dict[str, object] = {}

    def heed(self, flag: FaultFlag) -> None:
        """Note a flag and its age."""
        now = time.monotonic()
        stamp = flag.header.stamp.sec + 1e-9 * flag.header.stamp.nanosec
        self.flags.append(flag)
        self.came.append(now)
        self.ages.append(now - self.zero - stamp)

    def start(self, name: str, **values: object) -> None:
        """Start a node with parameters."""
        program = Path(get_package_prefix('damadics_fd'), 'lib', 'damadics_fd', name)
        words = [str(program), '--ros-args']
        for key, value in {**SETTINGS[self.mode], **values}.items():
            words += ['-p', f'{key}:={json.dumps(value)}']
        log = (self.folder / f'{name}.log').open('ab')
        self.processes[name] = subprocess.Popen(words, stdout=log, stderr=log)

    def spin(self, seconds: float, until=lambda: False) -> bool:
        """Take messages until something has come about."""
        end = time.monotonic() + seconds
        while not until() and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.01)
        return bool(until())

    def drive(self, seconds: float, until=lambda: False) -> bool:
        """Send samples in real time."""
        end = time.monotonic() + seconds
        while time.monotonic() < end and not until():
            due = int((time.monotonic() - self.zero) / PERIOD)
            for number in range(max(self.sent + 1, due - 50), due + 1):
                self.send(number)
            self.sent = due
            self.executor.spin_once(timeout_sec=PERIOD)
        return bool(until())

    def hurry(self, seconds: float, until=lambda: False) -> bool:
        """Send samples of so many seconds faster than in real time; go on in real time after."""
        began, first = time.monotonic(), self.sent
        while self.sent - first < seconds / PERIOD and not until():
            ahead = int((time.monotonic() - began) * AHEAD / PERIOD)
            for _ in range(min(first + ahead - self.sent, 100)):
                self.sent += 1
                self.send(self.sent)
            self.executor.spin_once(timeout_sec=PERIOD)
        self.zero = time.monotonic() - self.sent * PERIOD
        return bool(until())

    def send(self, number: int) -> None:
        """Send one sample."""
        message = self.valve.next(number)
        message.header.stamp.sec, hundredths = divmod(number, round(1 / PERIOD))
        message.header.stamp.nanosec = hundredths * 10_000_000
        message.header.frame_id = 'PREY'
        self.samples.publish(message)

    def has_alarm(self) -> bool:
        """Bring the valve to an alarm whose cause is over."""
        if self.mode == 'monitor':
            if not self.hurry(900.0, lambda: self.flags[-1].state == HEALTHY):
                return False
            self.hurry(60.0)  # until there is a signature and a trend to keep
            self.valve.faulty = True
            self.hurry(300.0, lambda: self.flags[-1].fault)
        else:
            self.valve.faulty = True
            self.drive(60.0, lambda: self.flags[-1].fault)
        self.valve.faulty = False
        self.drive(2.0)
        return bool(self.flags[-1].fault)

    def call(self, kind: type, name: str, patience: float = 10.0, drive: bool = False, **request):
        """Call a service; None where it does not answer."""
        if name not in self.clients:
            self.clients[name] = self.node.create_client(kind, name)
        client = self.clients[name]
        turn = self.drive if drive else self.spin
        if not turn(patience, until=client.service_is_ready):
            return None
        future = client.call_async(kind.Request(**request))
        turn(patience, until=future.done)
        return future.result() if future.done() else None

    def transit(self, node: str, step: int) -> bool:
        """Ask for a transition of the life cycle."""
        request = ChangeState.Request()
        request.transition.id = step
        answer = self.call(
            ChangeState, f'{node}/change_state', 20.0, transition=request.transition
        )
        return answer is not None and answer.success

    def ended(self) -> list[str]:
        """Return the names of processes that have ended."""
        return [name for name, process in self.processes.items() if process.poll() is not None]
