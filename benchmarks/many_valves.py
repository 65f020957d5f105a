# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The figures of `bench_fleet.py --json FILE`: process `fleet`, joined monitors, compiled loops.

Times are CPU times of whole processes, the sender's not among them; ratios are of one run.
"""

import array
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import rclpy
import yaml
from damadics_bringup.launcher import arguments_of_all
from damadics_bringup.processes import executable
from damadics_fd.core.bank import Bank
from damadics_fd.core.monitor import monitor_for
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.ros import qos
from damadics_fd.store.fleet_file import Valve
from damadics_fd.store.references import Reference, save_reference
from damadics_msgs.msg import Estimate, FleetLayout, FleetStatus, Float64Stamped, Measurement
from damadics_msgs.msg import MeasurementBlock as Block
from damadics_plant import simulate
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message

TICKS = os.sysconf('SC_CLK_TCK')
ROWS = 1000  # of a block
TAKEN = ('judged', 'refused by their monitors')
IDLE = 10.0  # s
PATIENCE = 180.0  # s
SINGLE, RATE, SECONDS = 10, 100.0, 8.0  # valves, samples a second and time of single messages


def cpu(pid: int) -> float:
    """Return the CPU time of a process [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def resident(pid: int) -> float:
    """Return the resident memory of a process [MB]."""
    return int(Path(f'/proc/{pid}/statm').read_text().split()[1]) * os.sysconf('SC_PAGESIZE') / 1e6


class Listener:
    """A node of the benchmark: sends, and keeps the newest message of each topic."""

    def __init__(self) -> None:
        self.node = rclpy.create_node('bench')
        self.latest: dict[str, object] = {}

    def listen(self, kind: type, topic: str, profile: QoSProfile) -> None:
        """Keep the newest message of a topic."""
        self.node.create_subscription(
            kind, topic, lambda message: self.latest.__setitem__(topic, message), profile
        )

    def wait(self, condition, patience: float = PATIENCE) -> None:
        """Take messages until something has come about."""
        deadline = time.monotonic() + patience
        while not condition():
            if time.monotonic() > deadline:
                raise SystemExit('the process under test does not answer')
            rclpy.spin_once(self.node, timeout_sec=0.05)

    def spin(self, seconds: float) -> None:
        """Take messages for a while."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            rclpy.spin_once(self.node, timeout_sec=0.05)

    def judged(self) -> int:
        """Return how many samples the fleet says that it has judged or refused as bad."""
        report = self.latest.get('/diagnostics')
        values = {v.key: v.value for s in report.status for v in s.values} if report else {}
        return sum(int(values.get(f'Samples {what}', 0)) for what in TAKEN)


@contextmanager
def running(words: list[str]) -> Iterator[subprocess.Popen]:
    """Run a process; SIGINT ends it."""
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.send_signal(2)
        process.wait(60.0)


def loops(valves: int = 10_000) -> dict[str, float]:
    """Compare the bank's loop, one row of each valve at a time, with the loop over columns."""
    run = simulate('random_nominal', model='lugre', rate=200.0, duration=200.0, noise=True)
    settings = Settings.for_mode('monitor', sample_rate=200.0)
    columns = {name: np.array(run.columns[name]) for name in ('stamp', *SIGNALS)}
    bank = Bank([settings] * valves)
    numbers = np.arange(valves)
    single, many = [], []
    chain = monitor_for(settings)
    chain.events(columns)  # compile
    bank.take(numbers[:1], np.zeros(1, np.int64), {'cv': np.full(1, 0.5), 'x1': np.full(1, 0.5)})
    for first in (0, 10, 20):
        chain.reset()
        began = time.process_time()
        chain.events(columns)
        single.append((time.process_time() - began) / len(columns['stamp']))
        instants = [
            (
                np.full(valves, columns['stamp'][n + 1]),
                {name: np.full(valves, columns[name][n + 1]) for name in SIGNALS},
            )
            for n in range(first, first + 10)
        ]
        began = time.process_time()
        for stamp, signals in instants:
            bank.take(numbers, stamp, signals)
        many.append((time.process_time() - began) / (10 * valves))
    return {'column_loop_us': 1e6 * min(single), 'kernel_us': 1e6 * min(many)}


def write_list(folder: Path, valves: int, mode: str) -> Path:
    """Write a list of valves; in mode scada each with a reference, learned of one of them."""
    slow = {'t_on': 60.0, 't_w': 60.0, 't_learn': 400.0} if mode == 'scada' else {}
    rate = 1.0 if mode == 'scada' else 200.0
    settings = Settings.for_mode(mode, sample_rate=rate, **slow)
    entries = {}
    learned = {}
    if mode == 'scada':
        chain = monitor_for(settings)
        chain.run(simulate('f16_B', rate=1.0, duration=800.0, noise=True).columns)
        learned = chain.learned()
    for n in range(valves):
        given = {'mode': mode, 'sample_rate': rate, **slow}
        if learned:
            path = folder / 'references' / f'lv{n:05d}'
            save_reference(path, Reference(f'lv{n:05d}', learned, settings.to_dict()))
            given['reference'] = str(path)
        entries[f'lv{n:05d}'] = {'settings': given}
    path = folder / f'{mode}_{valves}.yaml'
    path.write_text(yaml.safe_dump({'valves': entries}))
    return path


def fleet(folder: Path, valves: int, mode: str, samples: int) -> dict[str, float]:
    """Start the process `fleet`, leave it idle, send it blocks as fast as it takes them."""
    listener = Listener()
    for kind, topic, profile in (
        (FleetLayout, 'fleet/layout', qos.FLAG),
        (FleetStatus, 'fleet/status', qos.FLAG),
        (DiagnosticArray, '/diagnostics', QoSProfile(depth=10)),
    ):
        listener.listen(kind, topic, profile)
    publisher = listener.node.create_publisher(Block, 'measurement_block', qos.BLOCKS)
    path = write_list(folder, valves, mode)
    words = [str(path), '--ros-args', '-p', 'expose:=0', '-p', f'alarm_folder:={folder}/alarms']
    with running([executable('damadics_fd', 'fleet'), *words]) as process:
        listener.wait(lambda: {'fleet/layout', 'fleet/status'} <= set(listener.latest))
        start = cpu(process.pid)
        listener.wait(lambda: publisher.get_subscription_count() == 1)
        listener.spin(2.0)
        before = cpu(process.pid)
        listener.spin(IDLE)
        idle = (cpu(process.pid) - before) / IDLE
        memory = resident(process.pid)
        run = simulate('random_nominal', model='lugre', rate=200.0, duration=300.0, noise=True)
        if mode == 'scada':
            run = simulate('f16_B', rate=1.0, duration=800.0, noise=True, seed=7)
        version = listener.latest['fleet/layout'].version
        sent = 0
        before, blocks = cpu(process.pid), 0
        numbers = array.array('I', np.arange(valves, dtype=np.uint32).tobytes())
        instant = 0
        while sent < samples:
            message = Block(layout=version)
            message.header.frame_id = 'bench'
            instants = max(1, ROWS // valves)
            at = slice(instant, instant + instants)
            instant += instants
            message.valve = numbers * instants
            message.stamp = array.array('q', np.repeat(run.columns['stamp'][at], valves).tobytes())
            for name in SIGNALS:
                column = np.repeat(np.asarray(run.columns[name][at], np.float64), valves)
                setattr(message, name, array.array('d', column.tobytes()))
            publisher.publish(message)
            sent += len(message.stamp)
            blocks += 1
            if blocks % 50 == 0:
                listener.spin(0.05)
        deadline = time.monotonic() + PATIENCE
        while listener.judged() < sent and time.monotonic() < deadline:
            listener.spin(0.2)
        used = cpu(process.pid) - before
        judged = listener.judged()
        began = time.monotonic()
    ended = time.monotonic() - began
    listener.node.destroy_node()
    return {
        'start_cpu_s': start,
        'idle_percent': 100.0 * idle,
        'memory_mb': memory,
        'us': 1e6 * used / sent,
        'lost': sent - judged,
        'end_s': ended,
    }


def single_messages(words: list[str], heard: bool) -> float:
    """Send each of some valves its samples; return CPU time of a process per sample [us]."""
    listener = Listener()
    names = [f'lv{n:05d}' for n in range(SINGLE)]
    publishers = [
        listener.node.create_publisher(Measurement, f'/{name}/measurement', qos.SAMPLES)
        for name in names
    ]
    ears = []
    with running(words) as process:
        listener.wait(lambda: all(p.get_subscription_count() == 1 for p in publishers))
        if heard:
            ears = [subprocess.Popen([sys.executable, __file__, 'listen', *names])]
        listener.spin(5.0)
        before, sent = cpu(process.pid), 0
        began = time.monotonic()
        message = Measurement(cv=0.5, x1=0.5, p1=3.5e6, p2=2.6e6, t1=20.0, flow=5.0, ps=1e5)
        while sent < SECONDS * RATE:
            sent += 1
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(
                int(sent * 1e9 / RATE), 10**9
            )
            data = serialize_message(message)
            for publisher in publishers:
                publisher.publish(data)
            time.sleep(max(0.0, began + sent / RATE - time.monotonic()))
        time.sleep(1.0)
        used = cpu(process.pid) - before
        for ear in ears:
            ear.send_signal(2)
            ear.wait()
    listener.node.destroy_node()
    return 1e6 * used / (sent * SINGLE)


def listen(names: list[str]) -> None:
    """Subscribe to what the monitors of valves say of each sample, as a recorder does."""
    rclpy.init()
    node = rclpy.create_node('ears')
    for name in names:
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


def relay(names: list[str]) -> None:
    """Take the samples of valves and send as many prepared bytes, and nothing else."""
    from damadics_fd.ros.spin import spin

    class Relay(rclpy.node.Node):
        finished, exit_code = False, 0

        def __init__(self) -> None:
            super().__init__('relay')
            data = serialize_message(Estimate())
            for name in names:
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
    """Run monitors in one process whose estimates go over DDS, as before they were joined."""
    from damadics_fd.nodes import joint, monitors

    monitors.Joints = lambda: None  # each node then has joints of its own
    assert joint.Joints is not None
    sys.exit(monitors.main(words))


def figures(folder: Path) -> dict[str, float]:
    """
    Measure everything.

    :param folder: for lists, references and alarms.
    :return: figures by name.
    """
    rclpy.init()
    found = loops()
    many = fleet(folder, 1000, 'monitor', 2_000_000)
    few = fleet(folder, 10, 'monitor', 1000)
    scada = fleet(folder, 200, 'scada', 140_000)
    valves = [
        Valve(f'lv{n:05d}', settings={'sample_rate': RATE, 'alarm_folder': '', 'mode': 'monitor'})
        for n in range(SINGLE)
    ]
    words = arguments_of_all(valves, '/bench')
    joined = [executable('damadics_fd', 'monitors'), *words]
    names = [valve.name for valve in valves]
    relayed = single_messages([sys.executable, __file__, 'relay', *names], heard=False)
    silent = single_messages(joined, heard=False)
    heard = single_messages(joined, heard=True)
    before = single_messages([sys.executable, __file__, 'apart', *words], heard=True)
    rclpy.shutdown()
    return {
        'joined_over_relay': silent / relayed,
        'joined_heard_over_before': heard / before,
        'blocks_over_column_loop': many['us'] / found['column_loop_us'],
        'kernel_over_column_loop': found['kernel_us'] / found['column_loop_us'],
        'valves_per_core_200hz': 1e6 / (200.0 * many['us']),
        'valves_per_core_1hz_scada': 1e6 / scada['us'],
        'idle_percent_per_valve': many['idle_percent'] / 1000.0,
        'start_1000_cpu_s': many['start_cpu_s'],
        'rss_mb_per_valve': (many['memory_mb'] - few['memory_mb']) / 990.0,
        'lost': many['lost'] + few['lost'] + scada['lost'],
        **found,
        'blocks_us': many['us'],
        'scada_us': scada['us'],
        'relay_us': relayed,
        'joined_us': silent,
        'joined_heard_us': heard,
        'before_heard_us': before,
        'end_1000_s': many['end_s'],
    }


if __name__ == '__main__':
    {'listen': listen, 'relay': relay, 'apart': apart}[sys.argv[1]](sys.argv[2:])
