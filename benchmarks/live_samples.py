# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The valves of `live_fleet.py`: their samples in files, their references, their sender."""

import json
import sys
import time
from array import array
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import yaml
from damadics_fd.core.monitor import monitor_for
from damadics_fd.core.sample import COLUMNS, SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.store.references import Reference, save_reference
from damadics_plant import load_scenario, simulate
from numpy.typing import NDArray

SECOND = 10**9
RUNS = 20  # healthy ones that the valves share, and valves with a fault
ABRUPT = ('f1_B', 'f2_B', 'f7_B', 'f10_B', 'f13_B', 'f15_B', 'f16_B', 'f17_B', 'f18_B', 'f19_B')
SUDDEN = ('random_friction', 'random_spring')
SLOW = {'t_on': 60.0, 't_w': 60.0, 't_learn': 400.0}


@dataclass(frozen=True)
class Kind:
    """Valves of one mode."""

    name: str  # namespace of their fleet
    mode: str
    rate: float  # Hz
    parts: int  # blocks that all valves are parted into
    every: int  # instants of a block
    before: float  # s that arm a valve
    skip: float  # s of a run before its first sample that is sent; the control room learns there


KINDS = (
    Kind('slow', 'scada', 1.0, 10, 1, 90.0, 600.0),
    Kind('fast', 'monitor', 100.0, 4, 4, 90.0, 20.0),
)


def settings_of(kind: Kind) -> Settings:
    """Return the settings of the valves of a kind."""
    return Settings.for_mode(
        kind.mode, sample_rate=kind.rate, **(SLOW if kind.mode == 'scada' else {})
    )


def simulated(kind: Kind, onset: float | None, seed: int, end: float) -> dict[str, NDArray]:
    """Return the columns of a run; with a fault where there is an onset."""
    scada = kind.mode == 'scada'
    if onset is None:
        scenario = load_scenario('nominal' if scada else 'random_nominal')
    else:
        scenario = load_scenario(
            (ABRUPT if scada else SUDDEN)[seed % len(ABRUPT if scada else SUDDEN)]
        )
        faults = tuple(replace(fault, start=onset) for fault in scenario.faults)
        scenario = replace(scenario, faults=faults)
    model = 'dablib' if scada else 'lugre'
    run = simulate(scenario, kind.rate, model, noise=True, seed=seed, duration=end)
    return {name: np.asarray(run.columns[name]) for name in COLUMNS}


def names_of(kind: Kind, count: int) -> list[str]:
    """Return the names of the valves."""
    return [f'{kind.name[0]}{n:05d}' for n in range(count)]


def make(kind: Kind, count: int, seconds: float, folder: Path) -> None:
    """Write the samples of a kind, its references and its list of valves."""
    settings = settings_of(kind)
    pieces, learned = [], []
    length = round((kind.before + seconds) * kind.rate)
    for faulty in (False, True):
        for n in range(RUNS):
            seed = 100 + n
            start = round(kind.skip * kind.rate)
            live = kind.skip + kind.before  # s of the run at which the count begins
            onset = live + min(seconds / 2.0, 10.0 + 2.0 * n) if faulty else None
            columns = simulated(kind, onset, seed, live + seconds + 1.0)
            pieces.append(
                np.stack([columns[name][start : start + length] for name in SIGNALS], axis=1)
            )
            chain = monitor_for(settings)
            if kind.mode == 'scada':
                stretch = {name: column[:start] for name, column in columns.items()}
            else:
                stretch = simulated(kind, None, seed, 200.0)
            chain.run(stretch)
            learned.append(chain.learned())
    np.save(folder / f'{kind.name}.npy', np.array(pieces))
    rows = run_of(count)
    entries = {}
    for n, name in enumerate(names_of(kind, count)):
        path = folder / 'references' / name
        save_reference(path, Reference(name, learned[rows[n]], settings.to_dict()))
        given = {'mode': kind.mode, 'sample_rate': kind.rate, 'reference': str(path)}
        more = SLOW if kind.mode == 'scada' else {}
        entries[name] = {'settings': given | more, 'area': f'area {n // 100}'}
    (folder / f'{kind.name}.yaml').write_text(yaml.dump({'valves': entries}, Dumper=yaml.CDumper))


def run_of(count: int) -> NDArray[np.int64]:
    """Return the run that each valve shows: the faulty ones lie evenly among the others."""
    rows = np.arange(count) % RUNS
    rows[faulty_of(count)] = RUNS + np.arange(RUNS)
    return rows


def faulty_of(count: int) -> NDArray[np.int64]:
    """Return the valves with a fault."""
    return (np.arange(RUNS) * (count // RUNS) + count // (2 * RUNS)).astype(np.int64)


def send(kind: Kind, count: int, seconds: float, folder: Path) -> None:
    """Send the samples of a kind: first those that arm the valves, then the others live."""
    import rclpy
    from damadics_fd.ros import qos
    from damadics_msgs.msg import FleetLayout
    from damadics_msgs.msg import MeasurementBlock as Block
    from rclpy.serialization import serialize_message

    rclpy.init()
    node = rclpy.create_node('sender', namespace=f'/{kind.name}')
    publisher = node.create_publisher(Block, 'measurement_block', qos.BLOCKS)
    layouts: list[FleetLayout] = []
    node.create_subscription(FleetLayout, 'fleet/layout', layouts.append, qos.FLAG)
    while not layouts or publisher.get_subscription_count() < 2:  # fleet and recorder
        rclpy.spin_once(node, timeout_sec=0.1)
    table = np.load(folder / f'{kind.name}.npy')
    rows = run_of(count)
    parts = [np.arange(g, count, kind.parts) for g in range(kind.parts)]
    period = round(SECOND / kind.rate)
    armed = round(kind.before * kind.rate)
    unsent = [0] * kind.parts  # first instant of each part
    origin = time.time_ns() + round((kind.before + 1.0) * SECOND)  # the count begins
    sent = live = blocks = 0
    late = cpu_before = 0.0
    for tick in range(len(table[0]) * kind.parts // kind.every):
        # the parts take turns: each block is sent at the instant of its newest sample
        g, newest = tick % kind.parts, tick * kind.every // kind.parts
        instants = np.arange(unsent[g], newest + 1)
        unsent[g] = newest + 1
        valves = parts[g]
        stamps = origin + (instants - armed) * period + shift(kind, g)
        message = Block(layout=layouts[0].version)
        message.header.frame_id = 'sender'
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(int(stamps[-1]), SECOND)
        message.valve = array('I', np.tile(valves, len(instants)).astype(np.uint32).tobytes())
        message.stamp = array('q', np.repeat(stamps, len(valves)).tobytes())
        values = table[rows[valves][:, None], instants].transpose(2, 1, 0)
        for name, column in zip(SIGNALS, values, strict=True):  # instant by instant
            setattr(message, name, array('d', column.tobytes()))
        data = serialize_message(message)
        time.sleep(max(0.0, stamps[-1] / SECOND - time.time()))
        publisher.publish(data)
        if newest == armed and not live:
            cpu_before = time.process_time()
        sent, blocks = sent + len(message.stamp), blocks + 1
        if newest >= armed:
            live += len(message.stamp)
            late = max(late, time.time() - stamps[-1] / SECOND)
    used = time.process_time() - cpu_before
    found = {
        'sent': sent,
        'live': live,
        'blocks': blocks,
        'origin': origin,
        'cpu_percent': 100.0 * used / seconds,
        'late_ms': 1e3 * late,
    }
    print(json.dumps(found), flush=True)
    sys.stdin.readline()  # what was published goes with this process


def shift(kind: Kind, g: int) -> int:
    """Return by how much the instants of a part of the valves are later than the first's [ns]."""
    return g * round(SECOND / kind.rate / kind.parts) if kind.every == 1 else 0
