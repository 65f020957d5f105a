# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The OPC UA connector beside a bare asyncua subscription to the same server, one after the other.

The server is written in Python, and too slow for both at a time. CPU time per changed value of
both, start, memory, and whether every change came with its own time and value:
`python benchmarks/bench_connect.py --valves 1000 --fast 20 --seconds 20`.
"""

import argparse
import asyncio
import contextlib
import os
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[1]
SERVER = ROOT / 'tests' / 'connect' / 'opcua_server.py'
ENDS = {'cv': 'CV', 'x1': 'PV', 'p1': 'P1', 'p2': 'P2', 't1': 'T1', 'flow': 'FLOW', 'ps': 'PS'}
SETTLED = 3.0  # s after the first samples of all, which hold what was there before
TICK = os.sysconf('SC_CLK_TCK')


def cpu(pid: int) -> float:
    """Return the CPU time of a process [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def memory(pid: int) -> float:
    """Return the resident memory of a process [MB]."""
    for line in Path(f'/proc/{pid}/status').read_text().splitlines():
        if line.startswith('VmRSS'):
            return int(line.split()[1]) / 1024
    return 0.0


def wait_for_port(port: int) -> None:
    """Wait until the server listens."""
    while True:
        with socket.socket() as probe:
            if probe.connect_ex(('127.0.0.1', port)) == 0:
                return
        time.sleep(0.5)


async def bare(url: str, valves: int, fast: int, ends: list[str]) -> None:
    """Subscribe as the library's documentation does, and count."""
    from asyncua import Client

    class Handler:
        count = 0

        def datachange_notification(self, node, value, data) -> None:
            self.count += 1
            self.newest = data.monitored_item.Value.SourceTimestamp

    handlers = []
    async with Client(url, timeout=60) as client:
        for begin, end, interval, queue in (
            (0, valves, 500, 4),
            (valves, valves + fast, 20, 102),
        ):
            nodes = [client.get_node(f'ns=2;s=LV{n}.{e}') for n in range(begin, end) for e in ends]
            if nodes:
                handlers.append(Handler())
                subscription = await client.create_subscription(interval, handlers[-1])
                await subscription.subscribe_data_change(nodes, queuesize=queue)
        print('ready', flush=True)
        while True:
            await asyncio.sleep(0.2)
            print(sum(handler.count for handler in handlers), flush=True)


async def answers(url: str) -> None:
    """Wait until the server has forgotten a client that was killed, which may take seconds."""
    from asyncua import Client

    soon = 0
    while soon < 5:
        began = time.monotonic()
        with contextlib.suppress(ConnectionError, TimeoutError, OSError):
            async with Client(url, timeout=60) as client:
                await client.get_namespace_array()
                soon = soon + 1 if time.monotonic() - began < 0.5 else 0
        await asyncio.sleep(0.2)


class Follower:
    """A process whose last line of output is a count."""

    def __init__(self, words: list[str]) -> None:
        self.began = time.monotonic()
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        self.start = 0.0  # s until it had subscribed
        self.count = 0
        os.set_blocking(self.process.stdout.fileno(), False)

    def read(self) -> int:
        """Return the newest count."""
        for line in self.process.stdout:
            if line.strip().isdigit():
                self.count = int(line)
            elif line.strip() == 'ready':
                self.start = time.monotonic() - self.began
        return self.count


def main() -> None:
    """Run both and print the comparison."""
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument('--valves', type=int, default=1000, help='at 1 Hz')
    p.add_argument('--fast', type=int, default=20, help='at 50 Hz')
    p.add_argument('--signals', type=int, default=7, choices=range(2, 8), help='of each valve')
    p.add_argument('--seconds', type=float, default=20.0)
    p.add_argument('--behind', type=float, default=0.0, help='share of time the server lags by')
    p.add_argument('--port', type=int, default=48400)
    p.add_argument('--bare', action='store_true', help=argparse.SUPPRESS)
    options = p.parse_args()
    ends = dict(list(ENDS.items())[: options.signals])
    url = f'opc.tcp://127.0.0.1:{options.port}'
    if options.bare:
        while True:  # a busy server may lose a client while it subscribes
            with contextlib.suppress(ConnectionError, TimeoutError):
                asyncio.run(bare(url, options.valves, options.fast, [*ends.values()]))
    import rclpy
    from damadics_bringup.processes import executable, free_domain, surroundings
    from damadics_fd.ros import qos
    from damadics_msgs.msg import MeasurementBlock

    domain = free_domain()
    os.environ.update(surroundings(domain))
    folder = Path(tempfile.mkdtemp())
    valves = {
        f'lv{n}': {
            'period': 1.0 if n < options.valves else 0.02,
            'signals': {s: {'node': f'ns=2;s=LV{n}.{e}'} for s, e in ends.items()},
        }
        for n in range(options.valves + options.fast)
    }
    config = {'server': url, 'publish': 'blocks', 'valves': valves}
    (folder / 'plant.yaml').write_text(yaml.safe_dump(config, sort_keys=False))
    size = [str(options.valves), '--rate', '1', '--fast', str(options.fast)]
    size += ['--signals', str(options.signals), '--behind', str(options.behind)]
    rclpy.init(domain_id=domain)
    node = rclpy.create_node('bench')
    rows: dict[int, dict[int, float]] = {}  # position by stamp, by valve

    def take(block: MeasurementBlock) -> None:
        for valve, stamp, x1 in zip(block.valve, block.stamp, block.x1, strict=True):
            rows.setdefault(valve, {})[stamp] = x1

    node.create_subscription(MeasurementBlock, '/measurement_block', take, qos.SAMPLES)
    children = []
    try:
        server = subprocess.Popen([sys.executable, str(SERVER), str(options.port), *size])
        children.append(server)
        wait_for_port(options.port)
        library = Follower([sys.executable, __file__, '--bare', *sys.argv[1:]])
        children.append(library.process)
        while library.read() < options.signals * options.valves:
            time.sleep(0.1)
        theirs, values = -cpu(library.process.pid), -library.read()
        time.sleep(options.seconds)
        theirs += cpu(library.process.pid)
        values += library.read()
        size_of_theirs = memory(library.process.pid)
        library.process.kill()
        library.process.wait()
        asyncio.run(answers(url))
        began = time.monotonic()
        program = executable('damadics_connect', 'opcua')
        connector = subprocess.Popen([program, str(folder / 'plant.yaml')])
        children.append(connector)
        while len(rows) < len(valves) and time.monotonic() - began < 120.0:
            rclpy.spin_once(node, timeout_sec=0.1)
        start = time.monotonic() - began
        end = time.monotonic() + SETTLED
        while time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.1)
        rows.clear()
        ours = -cpu(connector.pid)
        end = time.monotonic() + options.seconds
        while time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.1)
        ours += cpu(connector.pid)
        samples = sum(len(stamps) for stamps in rows.values())
        print(
            f'{len(valves)} valves: all heard {start:.1f} s after the start; '
            f'bare asyncua had subscribed after {library.start:.1f} s'
        )
        own = options.signals * max(samples, 1)
        print(
            f'connector: {samples} samples, {1e6 * ours / own:.1f} us a value, '
            f'{1e6 * ours / max(samples, 1):.0f} us a sample, {memory(connector.pid):.0f} MB'
        )
        print(
            f'bare asyncua: {values} values, {1e6 * theirs / max(values, 1):.1f} us a value, '
            f'{size_of_theirs:.0f} MB'
        )
        ratio = (ours / own) / max(theirs / max(values, 1), 1e-12)
        print(f'connector / bare, CPU a value: {ratio:.2f}')
        for kind, begin, stop, period in (
            ('1 Hz', 0, options.valves, 10**9),
            ('50 Hz', options.valves, len(valves), 2 * 10**7),
        ):
            mine = [sorted(rows.get(n, ())) for n in range(begin, stop)]
            steps = [b - a for stamps in mine for a, b in zip(stamps, stamps[1:], strict=False)]
            exact = sum(stamp % period == 0 for stamps in mine for stamp in stamps)
            total = sum(map(len, mine))
            held = 0
            for n, stamps in zip(range(begin, stop), mine, strict=True):
                taken = [rows[n][stamp] for stamp in stamps]
                held += sum(a == b for a, b in zip(taken, taken[1:], strict=False))
            print(
                f'{kind}: {total} samples, {exact} with the exact source time, '
                f'{sum(step != period for step in steps)} steps other than the period, '
                f'{held} values held that had changed'
            )
    finally:
        for child in reversed(children):
            child.terminate()
            child.wait()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
