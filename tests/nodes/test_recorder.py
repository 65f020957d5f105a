# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The recorder as a process over DDS: nothing lost, closed properly, safe against a kill."""

import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from conftest import PATIENCE
from damadics_fd.bag import read_columns
from damadics_fd.bag.checking.inspection import LOSSY, WHOLE, inspect
from damadics_fd.ros.loss_count import Sequence
from damadics_msgs.msg import (
    FaultFlag,
    FleetLayout,
    Float64Stamped,
    Measurement,
    MeasurementBlock,
)
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile

pytestmark = pytest.mark.ros
RATE = 1000  # messages per second and topic


class Graph:
    """A node that publishes, and recorders as processes, in a domain of their own."""

    def __init__(self, domain: int) -> None:
        self.context = rclpy.context.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node('source', context=self.context)
        deep = QoSProfile(depth=20_000)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.measurement = self.node.create_publisher(Measurement, 'measurement', deep)
        self.residual = self.node.create_publisher(Float64Stamped, 'residual', deep)
        self.flag = self.node.create_publisher(FaultFlag, 'fault_flag', latched)
        self.processes: list[subprocess.Popen] = []
        self.sent = 0

    def record(self, *args: object) -> subprocess.Popen:
        command = [sys.executable, '-m', 'damadics_fd.commands.record', *map(str, args)]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.processes.append(process)
        deadline = time.monotonic() + PATIENCE
        wanted = [self.measurement, self.residual]
        while any(p.get_subscription_count() == 0 for p in wanted):
            assert process.poll() is None, process.stderr.read()
            assert time.monotonic() < deadline, 'the recorder does not subscribe'
            time.sleep(0.02)
        time.sleep(0.2)
        return process

    def publish(self, count: int) -> float:
        """Publish samples on two topics; return the wall time of the last."""
        begin = time.monotonic()
        for _ in range(count):
            measurement = Measurement(x1=float(self.sent))
            measurement.header.stamp.sec, rest = divmod(self.sent, RATE)
            measurement.header.stamp.nanosec = rest * 1_000_000
            self.measurement.publish(measurement)
            self.residual.publish(Float64Stamped(header=measurement.header, data=1.0))
            self.sent += 1
            ahead = begin + (self.sent % count) / RATE - time.monotonic()
            if ahead > 0.005:
                time.sleep(ahead)
        return time.time()

    def raise_flag(self, fault: bool) -> None:
        self.flag.publish(FaultFlag(fault=fault))

    def close(self) -> None:
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.communicate()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def graph(domain):
    graph = Graph(domain)
    yield graph
    graph.close()


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_every_message_is_in_the_bag_when_a_signal_ends_it(graph, tmp_path, number):
    graph.raise_flag(True)  # latched: published before there is a recorder
    process = graph.record('--all', '--out', tmp_path / 'bag')
    graph.publish(2000)
    process.send_signal(number)
    out, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, error
    assert out.startswith('recording /')
    assert ' messages, ' in out.splitlines()[-1]
    report = inspect(tmp_path / 'bag')
    assert report.code == WHOLE, report.problems
    columns = read_columns(tmp_path / 'bag', '/measurement')
    assert columns['x1'].tolist() == list(range(2000))
    assert (columns['stamp'] == np.arange(2000) * 1_000_000).all()
    assert (np.diff(columns['log_time']) >= 0).all()
    assert len(read_columns(tmp_path / 'bag', '/residual')['data']) == 2000
    assert read_columns(tmp_path / 'bag', '/fault_flag')['fault'].tolist() == [1]
    metadata = (tmp_path / 'bag' / 'metadata.yaml').read_text()
    assert 'durability: transient_local' in metadata
    assert '/estimate' not in metadata  # nobody published it


def test_blocks_are_recorded_with_the_list_of_their_valves(graph, tmp_path):
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    layouts = graph.node.create_publisher(FleetLayout, 'fleet/layout', latched)
    blocks = graph.node.create_publisher(MeasurementBlock, 'measurement_block', 100)
    names = ['/lv1', '/lv2']
    layouts.publish(FleetLayout(version=3, valve=names, actuator=names, area=['', '']))
    topics = ['measurement', 'residual', 'measurement_block']  # and not fleet/layout
    process = graph.record(*topics, '--out', tmp_path / 'bag')
    deadline = time.monotonic() + PATIENCE
    while not (blocks.get_subscription_count() and layouts.get_subscription_count()):
        assert time.monotonic() < deadline, 'the recorder does not subscribe'
        time.sleep(0.02)
    for n in range(50):
        message = MeasurementBlock(layout=3, valve=[0, 1], stamp=[n, n])
        message.cv, message.x1 = [0.25, 0.75], [float(n), -float(n)]
        blocks.publish(message)
    assert blocks.wait_for_all_acked()
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, error
    assert inspect(tmp_path / 'bag').code == WHOLE
    found = read_columns(tmp_path / 'bag', '/measurement_block', valve='/lv2')
    assert found['x1'].tolist() == [-float(n) for n in range(50)]
    assert set(found['cv']) == {0.75} and np.isnan(found['ps']).all()


def test_messages_lost_on_the_way_are_counted(graph, tmp_path):
    process = graph.record('--out', tmp_path / 'bag')
    shallow = graph.node.create_publisher(Float64Stamped, 'shallow', QoSProfile(depth=5))
    told = []
    graph.node.create_subscription(DiagnosticArray, '/diagnostics', told.append, 10)
    deadline = time.monotonic() + PATIENCE
    while shallow.get_subscription_count() == 0:
        assert time.monotonic() < deadline, 'the recorder does not subscribe'
        time.sleep(0.02)
    time.sleep(0.5)
    message = Float64Stamped(data=1.0)
    for _ in range(20):
        shallow.publish(message)
        time.sleep(0.01)
    process.send_signal(signal.SIGSTOP)  # held up: the publisher forgets what it cannot deliver
    time.sleep(0.1)
    for _ in range(30_000):
        shallow.publish(message)
    process.send_signal(signal.SIGCONT)
    for _ in range(100):
        time.sleep(0.01)
        shallow.publish(message)
    deadline = time.monotonic() + PATIENCE
    executor = rclpy.executors.SingleThreadedExecutor(context=graph.context)
    executor.add_node(graph.node)

    def lost_so_far() -> int:
        values = {v.key: v.value for v in told[-1].status[0].values} if told else {}
        return int(values.get('Messages lost on /shallow', 0))

    while lost_so_far() < 1000 and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.2)
    process.terminate()
    out, error = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, error
    recorded = len(read_columns(tmp_path / 'bag', '/shallow')['data'])
    lost = int(re.search(r'(\d+) lost on the way', out)[1])
    assert lost > 1000
    assert recorded + lost == 30_120
    assert told[-1].status[0].level == DiagnosticStatus.WARN
    assert lost_so_far() == lost


def test_numbers_count_only_where_one_publisher_gave_them():
    sequence = Sequence()
    for number in (7, 8, 11):
        sequence.note(number)
    sequence.settle([b'a'])  # of whom the first ones are is not known
    assert sequence.lost == 0
    for number in (12, 15, 16):
        sequence.note(number)
    sequence.settle([b'a'])
    assert sequence.lost == 2
    for number in (17, 3, 18):
        sequence.note(number)
    sequence.settle([b'a', b'b'])
    assert sequence.lost == 2
    sequence.settle([b'b'])
    for number in (4, 9):
        sequence.note(number)
    sequence.settle([])  # it has gone, and nobody else came
    assert sequence.lost == 6


def test_a_killed_recorder_loses_at_most_a_second(graph, tmp_path):
    process = graph.record('--out', tmp_path / 'bag')
    last = graph.publish(3000)
    process.kill()
    killed = time.time()
    process.wait()
    columns = read_columns(tmp_path / 'bag', '/measurement', on_problem=lambda _: None)
    recorded = len(columns['x1'])
    assert columns['x1'].tolist() == list(range(recorded))
    assert columns['log_time'][-1] / 1e9 > min(last, killed) - 1.0
    report = inspect(tmp_path / 'bag')
    assert report.code == LOSSY
    assert report.topics['/measurement'].count == recorded
    told: list[str] = []
    columns = read_columns(tmp_path / 'bag', on_problem=told.append)
    assert len(columns['x1']) == recorded
    assert 'was not closed' in told[0]


def test_named_topics_are_recorded_alone_and_split(graph, tmp_path):
    process = graph.record('measurement', 'residual', '--out', tmp_path / 'bag', '--split-s', '1')
    graph.raise_flag(True)
    graph.publish(2500)
    process.terminate()
    assert process.wait(timeout=PATIENCE) == 0
    assert len(list((tmp_path / 'bag').glob('*.mcap'))) >= 3
    report = inspect(tmp_path / 'bag')
    assert report.code == WHOLE
    assert {name: topic.count for name, topic in report.topics.items()} == {
        '/measurement': 2500,
        '/residual': 2500,
    }


def test_the_black_box_holds_what_was_before_and_after_a_fault(graph, tmp_path):
    process = graph.record('--out', tmp_path / 'box', '--black-box', '1', '0.5')
    graph.raise_flag(False)
    graph.publish(2000)
    graph.raise_flag(True)
    graph.publish(1500)
    process.terminate()
    assert process.wait(timeout=PATIENCE) == 0
    (bag,) = (tmp_path / 'box').iterdir()
    assert inspect(bag).code == WHOLE
    assert read_columns(bag, '/fault_flag')['fault'].tolist()[-1] == 1
    flagged = read_columns(bag, '/fault_flag')['log_time'][-1]
    columns = read_columns(bag, '/measurement')
    before, after = flagged - columns['log_time'][0], columns['log_time'][-1] - flagged
    assert 0.8e9 < before <= 1.0e9
    assert 0.4e9 < after < 0.7e9
    assert (np.diff(columns['x1']) == 1.0).all()


def test_errors_before_the_start_are_one_line(tmp_path):
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'file').write_text('x')
    result = subprocess.run(
        [sys.executable, '-m', 'damadics_fd.commands.record', '--out', str(tmp_path / 'bag')],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert result.returncode == 1
    assert result.stderr.strip().endswith('give the bag another name')
    assert result.stderr.count('\n') == 1
