# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Memory after a day of samples, fed as fast as they are taken: a detector, and a valve of the page.

    python benchmarks/bench_memory.py --hours 24 --rate 200

One simulated run of a moving valve is fed again and again, with stamps that go on; the page takes
serialised messages, as from the wire, and feeds its plots ten times a second of their time.
"""

import argparse
import resource
import time
from pathlib import Path

import numpy as np
from damadics_dashboard.live.valve import Valve
from damadics_dashboard.pages.plots import Curve, Feed
from damadics_fd.core.monitor import monitor_for
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.core.stamps import SECOND as NANO
from damadics_msgs.msg import Estimate, Float64Stamped, Measurement
from damadics_plant import simulate
from rclpy.serialization import serialize_message

PIECE = 0.1  # s of samples that the page collects at once
STAMP = slice(4, 12)  # of a serialised message with a header
DIFFERENT = 2000  # messages of the page that differ in more than their stamp


def resident() -> float:
    """Return the resident memory [MB]."""
    pages = int(Path('/proc/self/statm').read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def serialised(columns: dict[str, np.ndarray]) -> dict[str, list[bytearray]]:
    """Return the messages of the page's topics, of which only the stamps are changed later."""
    topics: dict[str, list[bytearray]] = {'measurement': [], 'estimate': [], 'threshold': []}
    for n in range(len(columns['cv'])):
        measurement = Measurement(**{name: float(columns[name][n]) for name in SIGNALS})
        measurement.header.frame_id = 'LV-101'
        estimate = Estimate(x1=measurement.x1, u=0.3, xi2=0.01, phase=3, progress=1.0)
        threshold = Float64Stamped(data=0.5)
        for topic, message in zip(topics, (measurement, estimate, threshold), strict=True):
            topics[topic].append(bytearray(serialize_message(message)))
    return topics


def main() -> None:
    """Feed and print the memory of every two hours."""
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument('--hours', type=float, default=24.0)
    p.add_argument('--rate', type=float, default=200.0)
    options = p.parse_args()
    period = int(NANO / options.rate)
    run = simulate('random_nominal', rate=options.rate, model='lugre', seed=1)
    columns = {name: np.array(run[name]) for name in SIGNALS}
    rows = len(columns['cv'])
    topics = serialised({name: values[:DIFFERENT] for name, values in columns.items()})
    monitor = monitor_for(Settings(mode='monitor', sample_rate=options.rate))
    valve = Valve('lv101')
    names = {'measurement': 'x1', 'estimate': 'residual', 'threshold': 'rho'}
    curves = {
        n: [Curve(valve.traces[topic], name)] for n, (topic, name) in enumerate(names.items())
    }
    feed = Feed(curves, 600.0)
    at, shown, alarms, began = 1_790_000_000 * NANO, 0.0, 0, time.monotonic()
    begin = at
    while (at - begin) / NANO < 3600.0 * options.hours:
        stamps = at + period * np.arange(rows, dtype=np.int64)
        result = monitor.run({**columns, 'stamp': stamps})
        alarms += len(result.events)
        del result
        step = max(int(PIECE * options.rate), 1)
        for first in range(0, rows, step):
            for n in range(first, min(first + step, rows)):
                head = np.array(divmod(int(stamps[n]), NANO), '<u4').tobytes()
                for topic, batch in valve.batches.items():
                    message = topics[topic][n % DIFFERENT]
                    message[STAMP] = head
                    batch.take(bytes(message))
            valve.collect(time.monotonic())
            feed.news()
        at += period * rows
        hours = (at - begin) / NANO / 3600.0
        if hours - shown >= 2.0 or hours < 0.2:
            shown = hours
            print(f'{hours:5.1f} h: {resident():6.1f} MB, {alarms} events', flush=True)
    pace = (at - begin) / NANO / (time.monotonic() - began)
    print(f'{pace:.0f} times as fast as real time')


if __name__ == '__main__':
    main()
