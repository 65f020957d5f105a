# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The figures of `bench_fleet.py --json FILE`: process `fleet`, joined monitors, compiled loops.

Times are CPU times of whole processes, the sender's not among them; ratios are of one run.
"""

import array
import os
import statistics
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import rclpy
import single_messages
import yaml
from damadics_bringup.processes import executable
from damadics_fd.core.bank.bank import Bank
from damadics_fd.core.monitor import monitor_for
from damadics_fd.core.record import Saved
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.ros import qos
from damadics_fd.store.references import Reference, save_reference
from damadics_msgs.msg import FleetLayout, FleetStatus
from damadics_msgs.msg import MeasurementBlock as Block
from damadics_plant import simulate
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile

TICKS = os.sysconf('SC_CLK_TCK')
ROWS = 1000  # of a block
TAKEN = ('judged', 'refused by their monitors')
IDLE = 10.0  # s
PATIENCE = 180.0  # s
SLOW = {'t_on': 60.0, 't_w': 60.0, 't_learn': 400.0}  # mode scada
REPEATS = 8  # of the compiled loops, in turns


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


class ColumnLoop:
    """The compiled loop over the columns of one valve: what all else is compared with."""

    def __init__(self) -> None:
        run = simulate('random_nominal', model='lugre', rate=200.0, duration=200.0, noise=True)
        self.settings = Settings.for_mode('monitor', sample_rate=200.0)
        self.columns = {name: np.array(run.columns[name]) for name in ('stamp', *SIGNALS)}
        self._chain = monitor_for(self.settings)
        self._chain.events(self.columns)  # compile

    def time(self) -> float:
        """Return the CPU time of a sample [s]."""
        self._chain.reset()
        began = time.process_time()
        self._chain.events(self.columns)
        return (time.process_time() - began) / len(self.columns['stamp'])


def loops(column: ColumnLoop, valves: int = 10_000) -> dict[str, float]:
    """Compare the bank's loop, one row of each valve at a time, with the loop over columns."""
    bank = Bank([column.settings] * valves)
    numbers = np.arange(valves)
    single, many = [], []
    for first in range(0, 10 * (REPEATS + 1), 10):
        single.append(column.time())
        instants = [
            (
                np.full(valves, column.columns['stamp'][n + 1]),
                {name: np.full(valves, column.columns[name][n + 1]) for name in SIGNALS},
            )
            for n in range(first, first + 10)
        ]
        began = time.process_time()
        for stamp, signals in instants:
            bank.take(numbers, stamp, signals)
        many.append((time.process_time() - began) / (10 * valves))
    pairs = list(zip(many, single, strict=True))[1:]  # in the first the memory is new
    return {
        'kernel_over_column_loop': statistics.median(a / b for a, b in pairs),
        'kernel_us': 1e6 * statistics.median(many[1:]),
        'column_loop_us': 1e6 * statistics.median(single),
    }


def learned_room(settings: Settings) -> Saved:
    """Return the reference of a valve in mode scada."""
    chain = monitor_for(settings)
    chain.run(simulate('f16_B', rate=1.0, duration=800.0, noise=True).columns)
    return chain.learned()


def burst(valves: int = 100, instants: int = 700) -> float:
    """Return the CPU time of the dearest instant after a common start, in usual ones."""
    settings = Settings.for_mode('scada', sample_rate=1.0, **SLOW)
    bank = Bank([settings] * valves)
    learned = learned_room(settings)
    for place in range(valves):
        bank.restore(place, learned)
    columns = simulate('f16_B', rate=1.0, duration=800.0, noise=True, seed=7).columns
    numbers, spent = np.arange(valves), []
    for n in range(instants):
        stamp = np.full(valves, columns['stamp'][n])
        signals = {name: np.full(valves, columns[name][n]) for name in SIGNALS}
        began = time.process_time()
        bank.take(numbers, stamp, signals)
        spent.append(time.process_time() - began)
    return max(spent[1:]) / statistics.median(spent)


def write_list(folder: Path, valves: int, mode: str) -> Path:
    """Write a list of valves; in mode scada each with a reference, learned of one of them."""
    slow = SLOW if mode == 'scada' else {}
    rate = 1.0 if mode == 'scada' else 200.0
    settings = Settings.for_mode(mode, sample_rate=rate, **slow)
    entries = {}
    learned = learned_room(settings) if mode == 'scada' else {}
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


def fleet(
    folder: Path, valves: int, mode: str, samples: int, between: Callable[[], float]
) -> dict[str, float]:
    """
    Start the process `fleet`, leave it idle, send it blocks as fast as it takes them.

    :param between: measures something else after each eighth of the samples.
    """
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
        date = time.time_ns()  # from which the samples count, as those of a driver
        sent = 0
        numbers = array.array('I', np.arange(valves, dtype=np.uint32).tobytes())
        instant = blocks = 0
        used, ratios = 0.0, []
        for part in range(1, REPEATS + 1):
            before, first = cpu(process.pid), sent
            while sent < part * samples // REPEATS:
                message = Block(layout=version)
                message.header.frame_id = 'bench'
                instants = max(1, ROWS // valves)
                at = slice(instant, instant + instants)
                instant += instants
                message.valve = numbers * instants
                stamps = np.repeat(run.columns['stamp'][at] + date, valves)
                message.stamp = array.array('q', stamps.tobytes())
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
            spent = cpu(process.pid) - before
            used += spent
            ratios.append(spent / (sent - first) / between())
        judged = listener.judged()
        began = time.monotonic()
    ended = time.monotonic() - began
    listener.node.destroy_node()
    return {
        'start_cpu_s': start,
        'idle_percent': 100.0 * idle,
        'memory_mb': memory,
        'us': 1e6 * used / sent,
        'ratio': statistics.median(ratios),
        'lost': sent - judged,
        'end_s': ended,
    }


def figures(folder: Path, before: Path | None = None) -> dict[str, float]:
    """
    Measure everything.

    :param folder: for lists, references and alarms.
    :param before: folder of the version that joined monitors are compared with, built.
    :return: figures by name.
    """
    rclpy.init()
    column = ColumnLoop()
    found = loops(column)
    many = fleet(folder, 1000, 'monitor', 2_000_000, column.time)
    few = fleet(folder, 10, 'monitor', 8000, column.time)
    scada = fleet(folder, 200, 'scada', 140_000, column.time)
    single = single_messages.figures(before)
    rclpy.shutdown()
    return {
        'blocks_over_column_loop': many['ratio'],
        'valves_per_core_200hz': 1e6 / (200.0 * many['us']),
        'valves_per_core_1hz_scada': 1e6 / scada['us'],
        'idle_percent_per_valve': many['idle_percent'] / 1000.0,
        'start_1000_cpu_s': many['start_cpu_s'],
        'rss_mb_per_valve': (many['memory_mb'] - few['memory_mb']) / 990.0,
        'lost': many['lost'] + few['lost'] + scada['lost'],
        'scada_burst': burst(),
        **found,
        'blocks_us': many['us'],
        'scada_us': scada['us'],
        'end_1000_s': many['end_s'],
        **single,
    }
