# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
What one message per sample costs: joined monitors against a bare relay, nodes apart, version 0.1.

All processes run at the same time, each in a domain of its own, and are sent samples in turns: a
machine that is busy with other work is then busy for all of them. Called by itself, this measures
nothing else:

    python benchmarks/single_messages.py figures [FOLDER OF ANOTHER VERSION, BUILT]
"""

import os
import statistics
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import rclpy
from damadics_bringup.launcher import arguments_of_all
from damadics_bringup.processes import executable, free_domain, surroundings
from damadics_fd.ros import qos
from damadics_fd.store.fleet_file import Valve
from damadics_msgs.msg import Estimate, Float64Stamped, Measurement
from rclpy.context import Context
from rclpy.serialization import serialize_message

VALVES, RATE = 10, 100.0  # and samples a second of each
TURNS, TURN = 6, 2.0  # of each process, and how long [s]
SETTLED = 4.0  # s after the start
PATIENCE = 180.0  # s
OWN_PATHS = (  # of this build: another one has its own
    'AMENT_PREFIX_PATH',
    'CMAKE_PREFIX_PATH',
    'COLCON_PREFIX_PATH',
    'LD_LIBRARY_PATH',
    'PYTHONPATH',
    'ROS_DISTRO',
    'VIRTUAL_ENV',
)
NAMES = [f'lv{n:05d}' for n in range(VALVES)]


def used(pid: int) -> float:
    """Return the CPU time of all threads of a process [s], finer than in ticks."""
    spent = 0.0
    for thread in Path(f'/proc/{pid}/task').iterdir():
        with suppress(OSError):  # it has ended meanwhile
            spent += int((thread / 'schedstat').read_text().split()[0]) / 1e9
    return spent


class Tested:
    """
    A process in a domain of its own that takes samples of some valves.

    :param words: its command line.
    :param heard: somebody listens to what it says of each sample.
    :param build: folder of another version of the project, built, that it is of.
    """

    def __init__(self, words: list[str], heard: bool, build: Path | None = None) -> None:
        domain = free_domain()
        environment = {**os.environ, **surroundings(domain)}
        theirs = environment
        if build:
            theirs = {name: x for name, x in environment.items() if name not in OWN_PATHS}
            words = ['bash', '-c', f'source {build}/env.sh && exec "$@"', 'bash', *words]
        quiet = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.DEVNULL}
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node(f'bench_{domain}', context=self._context)
        self._publishers = [
            self._node.create_publisher(Measurement, f'/{name}/measurement', qos.SAMPLES)
            for name in NAMES
        ]
        self._processes = [subprocess.Popen(words, env=theirs, **quiet)]
        if heard:
            ears = [sys.executable, __file__, 'listen']
            self._processes.append(subprocess.Popen(ears, env=environment, **quiet))
        self._heard = heard
        self._sent = 0

    def ready(self) -> bool:
        """Tell whether it takes the samples of all valves, and is listened to."""
        taken = all(p.get_subscription_count() == 1 for p in self._publishers)
        count = self._node.count_subscribers
        return taken and (
            not self._heard or all(count(f'/{name}/threshold') == 1 for name in NAMES)
        )

    def turn(self) -> float:
        """Send samples for a while; return the CPU time of the process per sample [us]."""
        pid = self._processes[0].pid
        before, first, began = used(pid), self._sent, time.monotonic()
        date = time.time_ns()  # a driver's samples are stamped with the date
        message = Measurement(cv=0.5, x1=0.5, p1=3.5e6, p2=2.6e6, t1=20.0, flow=5.0, ps=1e5)
        while (made := self._sent - first) < TURN * RATE:
            self._sent += 1
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(
                date + int((self._sent - first) * 1e9 / RATE), 10**9
            )
            data = serialize_message(message)
            for publisher in self._publishers:
                publisher.publish(data)
            time.sleep(max(0.0, began + (made + 1) / RATE - time.monotonic()))
        time.sleep(0.2)
        return 1e6 * (used(pid) - before) / (made * VALVES)

    def close(self) -> None:
        """End it."""
        for process in self._processes:
            process.send_signal(2)
        for process in self._processes:
            process.wait(60.0)
        self._node.destroy_node()
        self._context.try_shutdown()


@contextmanager
def tested(words: list[str], heard: bool = False, build: Path | None = None):
    """Run a process while it is needed."""
    one = Tested(words, heard, build)
    try:
        yield one
    finally:
        one.close()


def figures(before: Path | None = None) -> dict[str, float]:
    """
    Measure all processes in turns.

    :param before: folder of the version that is compared with, built; nodes apart by default.
    :return: CPU time per sample by process, the middle one of the turns [us], and the ratios, of
        turns that followed each other.
    """
    valves = [
        Valve(name, settings={'sample_rate': RATE, 'alarm_folder': '', 'mode': 'monitor'})
        for name in NAMES
    ]
    words = arguments_of_all(valves, '/bench')
    joined = [executable('damadics_fd', 'monitors'), *words]
    own = [sys.executable, __file__]
    with ExitStack() as stack:
        all_of = {
            'relay': stack.enter_context(tested([*own, 'relay'])),
            'joined': stack.enter_context(tested(joined)),
            'joined_heard': stack.enter_context(tested(joined, heard=True)),
            'apart_heard': stack.enter_context(tested([*own, 'apart', *words], heard=True)),
        }
        if before:
            monitors = before / 'ros2_ws/install/damadics_fd/lib/damadics_fd/monitors'
            all_of['before_heard'] = stack.enter_context(
                tested([str(monitors), *words], heard=True, build=before)
            )
        deadline = time.monotonic() + PATIENCE
        while not all(one.ready() for one in all_of.values()):
            if time.monotonic() > deadline:
                raise SystemExit('the processes under test do not answer')
            time.sleep(0.1)
        time.sleep(SETTLED)
        turns = [{name: one.turn() for name, one in all_of.items()} for _ in range(TURNS)]

    def middle(of: str, over: str) -> float:
        return statistics.median(turn[of] / turn[over] for turn in turns)

    return {
        'joined_over_relay': middle('joined', 'relay'),
        'joined_heard_over_before': middle(
            'joined_heard', 'before_heard' if before else 'apart_heard'
        ),
        'joined_heard_over_apart': middle('joined_heard', 'apart_heard'),
        **{f'{name}_us': statistics.median(turn[name] for turn in turns) for name in turns[0]},
    }


def listen() -> None:
    """Subscribe to what the monitors of valves say of each sample, as a recorder does."""
    rclpy.init()
    node = rclpy.create_node('ears')
    for name in NAMES:
        for kind, topic in (
            (Estimate, 'estimate'),
            (Float64Stamped, 'residual'),
            (Float64Stamped, 'threshold'),
        ):
            node.create_subscription(
                kind, f'/{name}/{topic}', lambda data: None, qos.SAMPLES, raw=True
            )
    with suppress(KeyboardInterrupt):
        rclpy.spin(node)


def relay() -> None:
    """Take the samples of valves and send as many prepared bytes, and nothing else."""
    from damadics_fd.ros.spin import spin

    class Relay(rclpy.node.Node):
        finished, exit_code = False, 0

        def __init__(self) -> None:
            super().__init__('relay')
            data = serialize_message(Estimate())
            for name in NAMES:
                out = self.create_publisher(Estimate, f'/{name}/estimate', qos.SAMPLES)
                self.create_subscription(
                    Measurement,
                    f'/{name}/measurement',
                    lambda _, out=out: out.publish(data),
                    qos.SAMPLES,
                    raw=True,
                )

    spin(Relay)


def apart(words: list[str]) -> None:
    """Run monitors in one process whose estimates go over DDS, as those of two processes."""
    from damadics_fd.nodes import monitors

    monitors.Joints = lambda: None  # each node then has joints of its own
    sys.exit(monitors.main(words))


if __name__ == '__main__':
    what, *words = sys.argv[1:] or ['figures']
    if what == 'apart':
        apart(words)
    elif what == 'figures':
        for name, value in figures(Path(words[0]).absolute() if words else None).items():
            print(f'{name:28s} {value:12.4g}')
    else:
        {'listen': listen, 'relay': relay}[what]()
