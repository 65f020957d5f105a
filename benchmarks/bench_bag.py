# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Measure reading, replaying and recording of bags against their peers, side by side in one run.

    python benchmarks/bench_bag.py               # reading, replay, memory
    python benchmarks/bench_bag.py --recorder    # recorder with publishers in other processes
    python benchmarks/bench_bag.py --topics 1000 # recorder beside a bare subscriber, 1 Hz each

CPU times are those of one process with all its threads, wall times need a quiet machine; the best
of several runs.
"""

import argparse
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from damadics_fd.bag import BagWriter, iter_columns, read_columns, write_columns
from damadics_fd.bag.mcap import loading
from damadics_fd.bag.rosbag2 import qos
from damadics_fd.core.sample import COLUMNS
from damadics_plant import simulate
from many_topics import many_topics
from numpy.typing import NDArray

SLOW_ROWS = 40_000  # read by the peers
ROWS = 400_000
RATE, PAPER = 200.0, 400.0  # [Hz]
MEASUREMENT = 'damadics_msgs/msg/Measurement'


def recording(n: int, rate: float = RATE) -> dict[str, np.ndarray]:
    """Return the measurements of a simulated healthy valve with noisy sensors."""
    run = simulate('nominal', rate, 'lugre', noise=True, duration=n / rate)
    return {name: run[name][:n] for name in COLUMNS}


def spent(task: Callable[[], object], repeats: int) -> NDArray[np.float64]:
    """Return the least CPU time and the least wall time of several runs [s]."""
    times = []
    for _ in range(repeats):
        wall, cpu = time.perf_counter(), time.process_time()
        task()
        times.append((time.process_time() - cpu, time.perf_counter() - wall))
    return np.min(times, axis=0)


def reading(folder: Path) -> None:
    """Columns against message-by-message decoding."""
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
    from rosbags.highlevel import AnyReader

    large, small = folder / 'large.mcap', folder / 'small.mcap'
    write_columns(large, recording(ROWS))
    write_columns(small, recording(SLOW_ROWS))

    def mcap_ros2() -> None:
        with small.open('rb') as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            for _, _, _, message in reader.iter_decoded_messages(['/measurement']):
                message.x1  # noqa: B018

    def rosbags() -> None:
        with AnyReader([small]) as reader:
            for connection, _, raw in reader.messages():
                reader.deserialize(raw, connection.msgtype).x1  # noqa: B018

    def pieces() -> None:
        for columns in iter_columns(large):
            len(columns['x1'])

    threads = loading.THREADS
    readers = {'read_columns': lambda: read_columns(large), 'iter_columns': pieces}
    measured = {}
    for number in sorted({1, threads}):
        loading.THREADS = number
        measured |= {
            f'{name}, threads: {number}': spent(reader, 15) / ROWS
            for name, reader in readers.items()
        }
    peers = {'rosbags': rosbags, 'mcap + mcap-ros2-support': mcap_ros2}
    slow = {name: spent(peer, 3) / SLOW_ROWS for name, peer in peers.items()}
    print(
        f'{"reading /measurement":28}{"CPU us/message":>16}{"wall":>8}'
        + ''.join(f'{name.split(" ")[0] + ": CPU x":>18}{"wall x":>8}' for name in slow)
    )
    for name, (cpu, wall) in (measured | slow).items():
        print(
            f'{name:28}{cpu * 1e6:16.4f}{wall * 1e6:8.4f}'
            + ''.join(f'{peer[0] / cpu:18.1f}{peer[1] / wall:8.1f}' for peer in slow.values())
        )
    print(f'bag: {large.stat().st_size / ROWS:.1f} B/message')


def replaying(folder: Path) -> None:
    """Read, decode, estimate, detect on one core."""
    from damadics_fd.bag.recording import Recording
    from damadics_fd.commands.replay.bags import Plan, replay, warm_up

    threads = loading.THREADS
    write_columns(folder / 'fast.mcap', recording(ROWS, PAPER))
    print(
        f'\n{"whole replay":28}{"M samples/s and core":>22}{"day at 200 Hz":>16}'
        f'{"M samples/s, wall":>20}'
    )
    # mode paper takes each sample that is slower than its own rate in two steps
    for mode, rate in (('paper', PAPER), ('paper', RATE), ('monitor', RATE)):
        source = Recording(folder / ('fast.mcap' if rate == PAPER else 'large.mcap'))
        warm_up([Plan(mode)])
        task = partial(replay, source, Plan(mode))
        for number in sorted({1, threads}):
            loading.THREADS = number
            cpu, wall = ROWS / spent(task, 10)
            name = f'{mode}, {rate:g} Hz, threads: {number}'
            print(f'{name:28}{cpu / 1e6:22.2f}{86400 * 200 / cpu:14.1f} s{wall / 1e6:20.2f}')


def memory(folder: Path) -> None:
    """Peak memory of a replay while the bag grows."""
    print(f'\n{"samples":>12}{"bag":>12}{"peak memory":>16}')
    for factor in (1, 10, 100):
        path = folder / f'{factor}.mcap'
        columns = recording(SLOW_ROWS)
        stamp = columns.pop('stamp')
        with BagWriter(path) as bag:
            bag.add_topic('/measurement', MEASUREMENT, [qos()])
            for part in range(factor):
                later = part * SLOW_ROWS * round(1e9 / RATE)
                bag.write_columns(stamp + later, {'/measurement': columns}, 'LC74_20')
        code = (
            'import sys, resource; from damadics_fd.commands.replay.replay import main;'
            'main([sys.argv[1], "--mode", "monitor", "--figures", sys.argv[2]]);'
            'print("peak", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3)'
        )
        out = subprocess.run(
            [sys.executable, '-c', code, str(path), str(folder / 'figures')],
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        peak = float(out.split('peak')[-1])
        print(f'{SLOW_ROWS * factor:12,}{path.stat().st_size / 1e6:9.1f} MB{peak:13.0f} MB')


PUBLISHER = """
import sys, time, rclpy
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from damadics_msgs.msg import Measurement
topic, rate, seconds, depth = sys.argv[1], *map(float, sys.argv[2:5])
rclpy.init()
node = rclpy.create_node('source' + topic.replace('/', '_'))
publisher = node.create_publisher(Measurement, topic, QoSProfile(depth=int(depth)))
message = Measurement()
message.header.frame_id = 'LC74_20'
raw = serialize_message(message)
while not publisher.get_subscription_count():
    time.sleep(0.05)
time.sleep(0.5)
begin = time.perf_counter()
sent = 0
while sent < rate * seconds:
    for _ in range(max(1, int(rate / 200))):
        publisher.publish(raw)
        sent += 1
    ahead = begin + sent / rate - time.perf_counter()
    if ahead > 0:
        time.sleep(ahead)
print(sent, sent / (time.perf_counter() - begin), flush=True)
time.sleep(2.0)
"""


def recorder(folder: Path, options: argparse.Namespace) -> None:
    """Messages from other processes into a bag: how many, how many lost."""
    env = os.environ | {
        'ROS_DOMAIN_ID': str(random.randrange(1, 100)),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
    }
    bag, publishers, seconds = folder / 'recorded', options.publishers, options.seconds
    burners = [
        subprocess.Popen([sys.executable, '-S', '-c', 'while True: pass'])
        for _ in range(options.burners)
    ]
    node = subprocess.Popen(
        [
            'nice',
            '-n',
            str(options.nice),
            sys.executable,
            '-m',
            'damadics_fd.commands.record',
            '--out',
            str(bag),
        ],
        env=env,
    )
    time.sleep(3.0 + options.burners)
    share = [str(value) for value in (options.rate / publishers, seconds, options.depth)]
    sources = [
        subprocess.Popen(
            [sys.executable, '-c', PUBLISHER, f'/m{i}', *share],
            env=env,
            stdout=subprocess.PIPE,
            text=True,
        )
        for i in range(publishers)
    ]
    answers = [source.communicate()[0].split() for source in sources]
    for burner in burners:
        burner.kill()
        burner.wait()
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    node.send_signal(signal.SIGTERM)
    node.wait()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    sent = sum(int(count) for count, _ in answers)
    got = sum(len(read_columns(bag, f'/m{i}', ['x1'])['x1']) for i in range(publishers))
    pace = sum(float(speed) for _, speed in answers)
    print(
        f'{publishers} publishers, {pace:,.0f} messages/s for {seconds:g} s: {sent:,} sent,'
        f' {got:,} recorded, {sent - got:,} lost; recorder {spent / seconds:.0%} of a core'
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--recorder', action='store_true')
    parser.add_argument('--topics', type=int, default=0, help='record so many topics at 1 Hz')
    parser.add_argument('--rate', type=float, default=20_000.0, help='messages per second')
    parser.add_argument('--seconds', type=float, default=60.0)
    parser.add_argument('--publishers', type=int, default=2)
    parser.add_argument('--depth', type=int, default=20_000, help='history of a publisher')
    parser.add_argument('--burners', type=int, default=0, help='processes that keep a core busy')
    parser.add_argument('--nice', type=int, default=0, help='niceness of the recorder')
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.topics:
            many_topics(folder, options.topics, options.seconds)
            return
        if options.recorder:
            recorder(folder, options)
            return
        reading(folder)
        replaying(folder)
        memory(folder)


if __name__ == '__main__':
    main()
