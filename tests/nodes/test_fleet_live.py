# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `fleet`, live: fifty valves in one process, one faulty; killed and started again."""

import array
import itertools
import time

import numpy as np
import pytest
import yaml
from conftest import PATIENCE
from damadics_bringup.policy import policy
from damadics_fd.core.monitor import Chain
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.core.text import SENTENCE
from damadics_fd.ros import qos
from damadics_fd.store.fleet_file import read_fleet
from damadics_msgs.msg import (
    FaultEvent,
    FaultFlag,
    FleetEvent,
    FleetIsolation,
    FleetLayout,
    FleetStatus,
    Float64Stamped,
    Measurement,
    MeasurementBlock,
)
from damadics_msgs.srv import FleetAcknowledge, FleetRelearn
from diagnostic_msgs.msg import DiagnosticArray
from permissions import assert_allowed
from rclpy.qos import QoSProfile

pytestmark = pytest.mark.ros
VALVES, FAULTY, LEARNING, OTHER = 50, 1, 2, 3  # valve OTHER sends its own measurement
EXPOSED = 4
PERIOD = 10_000_000  # ns
INSTANTS = 20  # of a block
# the printed method, with a latch: the alarm is to be there when the process is killed
PAPER = {'mode': 'paper', 'sample_rate': 100.0, 'latch': True, 'off_delay': 0.3, 'gw': 0.1}
REST = {'cv': 0.5, 'p1': 3.5e6, 'p2': 2.6e6, 'ps': 1e5}
THROWN = slice(300, 500)  # instants in which the faulty stem is thrown to and fro


def name(valve: int) -> str:
    return f'lv{valve:03d}'


def settings(valve: int) -> dict:
    learns = {'mode': 'monitor', 'sample_rate': 100.0, 't_on': 1.0, 't_w': 2.0}
    return learns if valve == LEARNING else dict(PAPER)


class Sender:
    """Sends blocks of all valves but one, and knows what it has sent."""

    def __init__(self, peer) -> None:
        self.peer = peer
        self.publisher = peer.node.create_publisher(
            MeasurementBlock, 'measurement_block', qos.BLOCKS
        )
        self.valves = np.array([v for v in range(VALVES) if v != OTHER], np.uint32)
        self.layout = 0
        self.faulty: list[tuple[int, float]] = []  # stamp and position

    def block(self) -> None:
        first = len(self.faulty)
        stamps = (1 + np.arange(first, first + INSTANTS)) * PERIOD
        x1 = np.full((INSTANTS, len(self.valves)), 0.5)
        thrown = THROWN.start <= first < THROWN.stop
        x1[:, FAULTY] += 0.1 * thrown * (first // INSTANTS % 2)
        self.faulty += zip(stamps.tolist(), x1[:, FAULTY].tolist(), strict=True)
        self.send(
            np.tile(self.valves, INSTANTS),
            np.repeat(stamps, len(self.valves)),
            {
                **{signal: np.full(x1.size, value) for signal, value in REST.items()},
                'x1': x1.ravel(),
            },
        )

    def send(self, valve, stamp, signals) -> None:
        message = MeasurementBlock(layout=self.layout)
        message.header.frame_id = 'gateway'
        message.valve = array.array('I', np.asarray(valve, np.uint32).tobytes())
        message.stamp = array.array('q', np.asarray(stamp, np.int64).tobytes())
        for signal, column in signals.items():
            setattr(message, signal, array.array('d', column.tobytes()))
        self.publisher.publish(message)

    def run_until(self, condition, patience: float = PATIENCE) -> bool:
        """Send blocks in real time until something has come about."""
        deadline = time.monotonic() + patience
        while not condition() and time.monotonic() < deadline:
            self.block()
            self.peer.wait(lambda: False, INSTANTS * PERIOD * 1e-9)
        return bool(condition())

    def single_monitor(self):
        stamps, x1 = zip(*self.faulty, strict=True)
        columns = {name: np.full(len(x1), np.nan) for name in SIGNALS}
        columns |= {signal: np.full(len(x1), value) for signal, value in REST.items()}
        columns['x1'] = np.array(x1)
        chain = Chain(Settings.from_mapping(PAPER))
        return chain.run({'stamp': np.array(stamps), **columns})


class Heard:
    """What one process of the fleet publishes."""

    def __init__(self, peer, processes, arguments: list[str]) -> None:
        self.peer = peer
        self.layouts = peer.listen(FleetLayout, 'fleet/layout', qos.FLAG)
        self.status = peer.listen(FleetStatus, 'fleet/status', qos.FLAG)
        self.events = peer.listen(FleetEvent, 'fleet/fault_event', qos.EVENTS)
        self.reports = peer.listen(DiagnosticArray, '/diagnostics', QoSProfile(depth=100))
        processes.start('damadics_fd', 'fleet', arguments)
        assert peer.wait(lambda: self.status and self.layouts), processes.log('fleet').read_text()

    def state(self, valve: int) -> int:
        return self.status[-1].state[valve]

    def says(self, key: str) -> str:
        found = [v.value for m in self.reports for s in m.status for v in s.values if v.key == key]
        return found[-1] if found else ''


def test_fifty_valves_in_one_process(processes, peer, tmp_path):
    path = tmp_path / 'fleet.yaml'
    path.write_text(
        yaml.safe_dump({'valves': {name(v): {'settings': settings(v)} for v in range(VALVES)}})
    )
    arguments = [
        str(path),
        *('--ros-args', '-p', f'expose:={EXPOSED}', '-p', f'alarm_folder:={tmp_path / "alarms"}'),
        *('-p', f'state_folder:={tmp_path / "states"}'),
    ]
    flags = peer.listen(FaultFlag, f'/{name(FAULTY)}/fault_flag', qos.FLAG)
    residuals = peer.listen(Float64Stamped, f'/{name(FAULTY)}/residual', qos.SAMPLES)
    causes = peer.listen(FleetIsolation, 'fleet/isolation', qos.EVENTS)
    own_events = peer.listen(FaultEvent, f'/{name(FAULTY)}/fault_event', qos.EVENTS)
    other_flags = peer.listen(FaultFlag, f'/{name(OTHER)}/fault_flag', qos.FLAG)
    sender = Sender(peer)
    own = peer.node.create_publisher(Measurement, f'/{name(OTHER)}/measurement', qos.SAMPLES)
    fleet = Heard(peer, processes, arguments)
    assert fleet.layouts[-1].valve == [f'/{name(v)}' for v in range(VALVES)]
    assert set(fleet.status[-1].state) == {FaultFlag.STATE_NOT_MONITORING}
    assert peer.wait(lambda: sender.publisher.get_subscription_count() == 1)
    assert peer.wait(lambda: own.get_subscription_count() == 1)

    assert_allowed(peer, policy(read_fleet(path), blocks=True), 'fleet')

    # a block of another layout is refused, counted, and judged by nobody
    sender.send([0], [1], {'cv': np.array([0.5])})
    assert peer.wait(lambda: fleet.says('Refused of gateway') == '1')
    sender.layout = fleet.layouts[-1].version

    # a fault is found in its valve alone, and told as a monitor of its own tells it
    assert sender.run_until(lambda: fleet.state(FAULTY) == FaultFlag.STATE_LATCHED)
    healthy = {v for v in range(VALVES) if fleet.state(v) == FaultFlag.STATE_HEALTHY}
    assert healthy == set(range(VALVES)) - {FAULTY, LEARNING, OTHER}
    assert fleet.state(LEARNING) == FaultFlag.STATE_LEARNING
    assert fleet.state(OTHER) == FaultFlag.STATE_NOT_MONITORING
    assert {event.valve for event in fleet.events} == {f'/{name(FAULTY)}'}
    result = sender.single_monitor()
    alone = result.events
    assert peer.wait(lambda: len(alone) == len(fleet.events) == len(own_events) and causes)
    assert peer.wait(lambda: flags[-1].state == FaultFlag.STATE_LATCHED)
    told = [m.event for m in fleet.events]
    assert [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in told] == [
        event.stamp for event in alone
    ]
    assert [m.occurrence for m in told] == [event.occurrence for event in alone]
    assert str(own_events) == str(told)  # NaN is not equal to itself
    assert flags[-1].occurrence == 1
    assert {(one.valve, one.isolation.occurrence) for one in causes} == {(f'/{name(FAULTY)}', 1)}
    assert causes[0].isolation.found_by == 'threshold'
    assert causes[0].isolation.text == told[0].text

    # whoever listens to an exposed valve hears every sample
    assert len(residuals) > INSTANTS
    heard = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in residuals]
    assert set(np.diff(heard)) == {PERIOD}
    rows = np.searchsorted(result.decisions['stamp'], heard)
    assert [m.data for m in residuals] == result.decisions['residual'][rows].tolist()

    # a valve may send its own measurement
    numbers = itertools.count(1)

    def measured_healthy() -> bool:
        message = Measurement(cv=0.5, x1=0.5, ps=1e5)
        stamp = message.header.stamp
        stamp.sec, stamp.nanosec = divmod(next(numbers) * PERIOD, 10**9)
        own.publish(message)
        return other_flags[-1].state == FaultFlag.STATE_HEALTHY

    assert peer.wait(measured_healthy)

    # a gateway may number the valves by a list of its own, some of them of other fleets
    layouts = peer.node.create_publisher(FleetLayout, 'fleet/layout', qos.FLAG)
    names = ['/elsewhere', f'/{name(OTHER)}']
    layouts.publish(FleetLayout(version=7, valve=names, actuator=['', ''], area=['', '']))
    assert peer.wait(lambda: fleet.layouts[-1].version == 7)
    assert peer.wait(lambda: layouts.get_subscription_count() == 2)
    assert layouts.wait_for_all_acked()
    refused = fleet.says('Refused of gateway')
    version, sender.layout = sender.layout, 7
    stamps = (next(numbers) + np.array([50, 50, 51, 51])) * PERIOD
    half = np.full(4, 0.5)
    sender.send([0, 1, 0, 1], stamps, {'cv': half, 'x1': half, 'ps': half})
    last = divmod(int(stamps[-1]), 10**9)
    assert peer.wait(
        lambda: (other_flags[-1].header.stamp.sec, other_flags[-1].header.stamp.nanosec) == last
    )
    assert fleet.says('Refused of gateway') == refused
    sender.layout = version

    # people act on one valve, some or all
    answer = peer.call(
        FleetAcknowledge, 'fleet/acknowledge', sender.run_until, valves=['*'], user='Anna'
    )
    assert not answer.success
    assert answer.message.startswith(f'done for 1 of {VALVES} valves')
    assert len(answer.message) <= SENTENCE
    assert sender.run_until(lambda: 'by Anna' in fleet.events[-1].event.text)
    answer = peer.call(
        FleetRelearn, 'fleet/relearn', sender.run_until, valves=[f'/{name(LEARNING)}', '/lv999']
    )
    assert answer.message == 'done for 1 of 2 valves; /lv999: there is no such valve'

    # killed and started again, it has the alarm as it was and shows no valve healthy unseen
    processes.kill('fleet')
    fleet = Heard(peer, processes, arguments)
    assert {s for m in fleet.status for s in m.state} == {FaultFlag.STATE_NOT_MONITORING}
    flags.clear()
    assert sender.run_until(lambda: flags and fleet.state(0) == FaultFlag.STATE_HEALTHY)
    assert fleet.state(FAULTY) == FaultFlag.STATE_LATCHED
    assert {flag.state for flag in flags} <= {
        FaultFlag.STATE_NOT_MONITORING,
        FaultFlag.STATE_LATCHED,
    }
    assert flags[-1].occurrence == 1
    assert not fleet.events, 'an alarm is told twice'

    # silence is not health
    assert peer.wait(lambda: set(fleet.status[-1].state) == {FaultFlag.STATE_NOT_MONITORING})
    processes.end('fleet')

    # two processes with a part of the list each go on where it was, without learning or an event
    halves = {'north': range(VALVES // 2), 'south': range(VALVES // 2, VALVES)}
    status = {}
    events = []
    for half, valves in halves.items():
        file = tmp_path / f'{half}.yaml'
        file.write_text(
            yaml.safe_dump({'valves': {name(v): {'settings': settings(v)} for v in valves}})
        )
        status[half] = peer.listen(FleetStatus, f'/{half}/fleet/status', qos.FLAG)
        events.append(peer.listen(FleetEvent, f'/{half}/fleet/fault_event', qos.EVENTS))
        words = [str(file), *arguments[1:], '-r', f'__ns:=/{half}', '-p', 'expose:=0']
        processes.start('damadics_fd', 'fleet', words, label=half)
    assert peer.wait(lambda: all(status.values()))
    assert len(status['north'][-1].state) + len(status['south'][-1].state) == VALVES
    flagged = [m for m in status['north'][-1].fault]
    assert flagged == [v == FAULTY for v in halves['north']]
    assert not any(status['south'][-1].fault)
    assert status['north'][-1].progress[LEARNING] > 0.0, 'it learns from the beginning'
    assert not any(events), 'an alarm is told twice'
    for half in halves:
        processes.end(half)
    for log in ('fleet', *halves):
        assert 'internal error' not in processes.log(log).read_text()
