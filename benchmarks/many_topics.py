# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The recorder with many slow topics, beside a bare subscriber: `bench_bag.py --topics 1000`."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

from damadics_fd.bag.opening import open_file

MANY = """
import sys, time
import rclpy
from damadics_msgs.msg import Float64Stamped
from rclpy.serialization import serialize_message
topics, seconds = int(sys.argv[1]), float(sys.argv[2])
rclpy.init()
node = rclpy.create_node('many')
publishers = [node.create_publisher(Float64Stamped, f'/many/t{i}', 10) for i in range(topics)]
print('ready', flush=True)
sys.stdin.readline()  # both listeners are there
raw = serialize_message(Float64Stamped(data=1.0))
begin, sent = time.monotonic(), 0
while sent < topics * seconds:
    publishers[sent % topics].publish(raw)
    sent += 1
    ahead = begin + sent / topics - time.monotonic()
    if ahead > 0.002:
        time.sleep(ahead)
print(sent, flush=True)
sys.stdin.readline()
"""
BARE = """
import os, sys, threading
import rclpy
from damadics_msgs.msg import Float64Stamped
rclpy.init()
node = rclpy.create_node('bare')
count = 0
def take(data):
    global count
    count += 1
for i in range(int(sys.argv[1])):
    node.create_subscription(Float64Stamped, f'/many/t{i}', take, 10, raw=True)
print('ready', flush=True)
def leave():  # the end of a thousand subscriptions takes minutes
    sys.stdin.readline()
    print(count, flush=True)
    os._exit(0)
threading.Thread(target=leave).start()
rclpy.spin(node)
"""
SETTLE = 30.0  # [s] for discovery of all topics, not counted


def cpu_of(pid: int) -> float:
    """Return the CPU time of a process so far [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def many_topics(folder: Path, topics: int, seconds: float) -> None:
    """Record many slow topics beside a subscriber that takes the same bytes and counts them."""
    env = os.environ | {
        'ROS_DOMAIN_ID': str(random.randrange(1, 100)),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
    }
    bag = folder / 'recorded'

    def start(*words: str) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        return subprocess.Popen(
            [sys.executable, *words], env=env, text=True, stdin=pipe, stdout=pipe
        )

    source = start('-c', MANY, str(topics), str(seconds))
    source.stdout.readline()
    bare = start('-c', BARE, str(topics))
    bare.stdout.readline()
    node = start('-m', 'damadics_fd.commands.record', '--out', str(bag))
    time.sleep(SETTLE)
    before = [cpu_of(process.pid) for process in (node, bare)]
    print('go', file=source.stdin, flush=True)
    sent = int(source.stdout.readline())
    spent = [
        cpu_of(process.pid) - start for process, start in zip((node, bare), before, strict=True)
    ]
    began = time.monotonic()
    node.send_signal(signal.SIGINT)
    node.communicate()
    ended = time.monotonic() - began
    heard = bare.communicate('end\n')[0]
    source.communicate('end')
    got = 0
    for file in bag.glob('*.mcap'):
        with open_file(file) as opened:
            got += sum(
                opened.stated.get(channel.id, 0)
                for channel in opened.channels.values()
                if channel.topic.startswith('/many/')
            )
    shares = [100.0 * used / seconds for used in spent]
    print(
        f'{topics} topics at 1 Hz for {seconds:g} s: {sent:,} sent, {got:,} recorded, '
        f'{heard.strip()} heard by the bare subscriber; recorder {shares[0]:.1f} % of a core, '
        f'bare subscriber {shares[1]:.1f} %, difference {shares[0] - shares[1]:.1f} %; ended in '
        f'{ended:.1f} s'
    )
