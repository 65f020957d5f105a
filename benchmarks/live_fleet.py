# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Thousands of valves live: two processes `fleet`, recorder, page and a browser, samples from files.

    python benchmarks/live_fleet.py --seconds 600 --json live.json

Valves of a control room at 1 Hz and valves with a monitor at 100 Hz, each with a reference and
armed before the count begins, 20 of each with a fault. The sender is a process of its own. Every
sample has to be judged and recorded, every fault found.
"""

import argparse
import json
import os
import select
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
from live_samples import KINDS, SECOND, Kind, faulty_of, make, names_of, send, shift

PATIENCE = 400.0  # s
ENDING = 120.0  # s that the processes may take to end
AFTER = 5.0  # s for the last words
HEALTHY = 2  # FaultFlag.STATE_HEALTHY


class Ear:
    """The node of this program: events with their time of arrival, statuses, diagnostics."""

    def __init__(self) -> None:
        import rclpy
        from damadics_fd.ros import qos
        from damadics_msgs.msg import FleetEvent, FleetStatus
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.experimental import EventsExecutor
        from rclpy.qos import QoSProfile

        rclpy.init()
        self.node = rclpy.create_node('live_fleet')
        self.executor = EventsExecutor()
        self.executor.add_node(self.node)
        self.events: dict[str, list[tuple[float, FleetEvent]]] = {kind.name: [] for kind in KINDS}
        self.status: dict[str, FleetStatus] = {}
        self.values: dict[str, dict[str, str]] = {}
        listen = self.node.create_subscription
        for kind in KINDS:
            heard, name = self.events[kind.name], kind.name
            listen(
                FleetEvent,
                f'/{name}/fleet/fault_event',
                lambda event, heard=heard: heard.append((time.time(), event)),
                qos.EVENTS,
            )
            listen(
                FleetStatus,
                f'/{name}/fleet/status',
                lambda status, name=name: self.status.__setitem__(name, status),
                qos.FLAG,
            )
        listen(DiagnosticArray, '/diagnostics', self._note, QoSProfile(depth=100))
        # in a thread: the browser holds this one up
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        while not self._ended.is_set():
            self.executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        """Listen no more."""
        self._ended.set()
        self._thread.join()
        self.executor.shutdown()
        self.node.destroy_node()

    def _note(self, message) -> None:
        for status in message.status:
            self.values[status.name.split('/')[0]] = {v.key: v.value for v in status.values}

    def wait(self, done: Callable[[], object], patience: float = PATIENCE) -> None:
        """Wait until something has come about."""
        deadline = time.monotonic() + patience
        while not done():
            if time.monotonic() > deadline:
                raise SystemExit('the processes do not answer')
            time.sleep(0.05)

    def judged(self, kind: Kind) -> int:
        """Return how many samples a fleet has judged."""
        return int(self.values.get(kind.name, {}).get('Samples judged', 0))


def delays(kind: Kind, count: int, origin: int, events) -> list[float]:
    """Return the time from the newest sample of its block to each alarm [ms]."""
    number = {f'/{name}': n for n, name in enumerate(names_of(kind, count))}
    period = round(SECOND / kind.rate)
    found = []
    for arrived, message in events:
        stamp = message.event.header.stamp.sec * SECOND + message.event.header.stamp.nanosec
        g = number[message.valve] % kind.parts
        instant = round((stamp - origin - shift(kind, g)) / period)
        if kind.every > 1:
            instant += (g - instant) % kind.parts
        newest = origin + instant * period + shift(kind, g)
        found.append(1e3 * (arrived - newest / SECOND))
    return found


class Page:
    """The fleet of all valves in a browser; nothing where there is none."""

    def __init__(self, address: str, chromium, valves: int) -> None:
        self._page = chromium.new_page(viewport={'width': 1440, 'height': 900})
        self._page.goto(address)
        self._page.wait_for_function(
            f"document.querySelectorAll('.tile').length >= {valves}", timeout=120_000
        )

    def figures(self) -> dict[str, float | str]:
        """Measure frames while the fleet is scrolled, and a search; else say why not."""
        from bench_page import FRAMES, SEARCH, renderer_of, resident
        from playwright.sync_api import Error

        found: dict[str, float | str] = {}
        try:
            found['renderer_mb'] = resident(renderer_of(self._page))
            found['frames_a_second'] = self._page.evaluate(FRAMES)
            found['search_ms'] = self._page.evaluate(SEARCH.replace('V-0123', 's0123'))
        except Error as problem:  # a page that lost its server opens itself again
            found['problem'] = problem.message
        return found


def run(options: argparse.Namespace, files: Path, folder: Path) -> dict[str, object]:
    """Run everything; return the figures."""
    files.mkdir(exist_ok=True)
    sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))
    import website
    from conftest import free_port
    from damadics_bringup.processes import Processes, free_domain, surroundings
    from damadics_fd.bag.opening import open_file
    from many_valves import cpu, resident

    counts = {'slow': options.slow, 'fast': options.fast}
    for kind in KINDS:
        if not (files / f'{kind.name}.yaml').exists():
            make(kind, counts[kind.name], options.seconds, files)
    domain, port = free_domain(), free_port()
    environment = {**surroundings(domain), 'XDG_STATE_HOME': str(folder / 'state')}
    os.environ.update(environment)
    bag = folder / 'bag'
    found: dict[str, object] = {'seconds': options.seconds, **counts}
    with (
        closing(Ear()) as ear,
        Processes(folder / 'logs', environment) as processes,
        website.browser() as chromium,
    ):
        for kind in KINDS:
            words = ['--ros-args', '-r', f'__ns:=/{kind.name}', '-p', 'expose:=0']
            words += ['-p', f'alarm_folder:={folder}/alarms_{kind.name}']
            processes.start(
                'damadics_fd', 'fleet', [f'{files}/{kind.name}.yaml', *words], kind.name
            )
        processes.start('damadics_fd', 'recorder', ['--out', str(bag)], 'recorder')
        processes.start('damadics_dashboard', 'dashboard', ['--port', str(port)], 'page')
        pids = {name: processes.pid(name) for name in ('slow', 'fast', 'recorder', 'page')}
        ear.wait(lambda: len(ear.status) == len(KINDS))
        started = {name: cpu(pid) for name, pid in pids.items()}
        website.wait_until_served(f'http://127.0.0.1:{port}')
        total = sum(counts.values())
        page = Page(f'http://127.0.0.1:{port}', chromium, total) if chromium else None
        senders = {
            kind.name: subprocess.Popen(
                [
                    sys.executable,
                    __file__,
                    *('--send', kind.name, '--folder', str(files)),
                    *('--valves', str(counts[kind.name]), '--seconds', str(options.seconds)),
                ],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            for kind in KINDS
        }
        begin = time.monotonic() + max(kind.before for kind in KINDS) + 2.0
        ear.wait(lambda: time.monotonic() > begin)
        found['armed'] = {
            kind.name: int(np.count_nonzero(np.asarray(ear.status[kind.name].state) == 2))
            for kind in KINDS
        }
        before = {name: cpu(pid) for name, pid in pids.items()}
        middle = begin + 0.5 * options.seconds
        ear.wait(lambda: time.monotonic() > middle, options.seconds)
        if page:
            found['page'] = page.figures()
        end = begin + options.seconds - 3.0
        ear.wait(lambda: time.monotonic() > end, options.seconds + PATIENCE)
        span = time.monotonic() - begin
        found['cpu_percent'] = {
            name: 100.0 * (cpu(pid) - before[name]) / span for name, pid in pids.items()
        }
        found['memory_mb'] = {name: resident(pid) for name, pid in pids.items()}
        found['start_cpu_s'] = started
        told = {}
        for name, sender in senders.items():
            ear.wait(lambda out=sender.stdout: select.select([out], [], [], 0.0)[0])
            told[name] = json.loads(sender.stdout.readline())
        found['senders'] = told
        last = time.monotonic() + AFTER
        ear.wait(lambda: time.monotonic() > last)
        for sender in senders.values():
            sender.communicate('end')
        began = time.monotonic()
        for pid in pids.values():
            os.kill(pid, signal.SIGINT)
        ear.wait(
            lambda: all(map(processes.ended, pids)) or time.monotonic() > began + ENDING,
            2.0 * ENDING,
        )
        found['ended_s'] = time.monotonic() - began
    recorded: dict[str, int] = {}
    for file in bag.glob('*.mcap'):
        with open_file(file) as opened:
            for channel in opened.channels.values():
                count = opened.stated.get(channel.id, 0)
                recorded[channel.topic] = recorded.get(channel.topic, 0) + count
    for kind in KINDS:
        sent = told[kind.name]
        names = names_of(kind, counts[kind.name])
        faulty = {f'/{names[n]}' for n in faulty_of(len(names))}
        events = [(when, e) for when, e in ear.events[kind.name] if e.event.transition == 0]
        raised = {event.valve for _, event in events}
        late = delays(kind, len(names), sent['origin'], events)
        found[kind.name] = {
            'valves': len(names),
            'judged': ear.judged(kind),
            'lost': sent['sent'] - ear.judged(kind),
            'blocks_not_recorded': sent['blocks']
            - recorded.get(f'/{kind.name}/measurement_block', 0),
            'faults_found': len(raised & faulty),
            'false_alarms': len(raised - faulty),
            'latency_ms_p50': statistics.median(late) if late else None,
            'latency_ms_max': max(late, default=None),
        }
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seconds', type=float, default=600.0, help='after the valves are armed')
    parser.add_argument('--slow', type=int, default=10_000, help='valves at 1 Hz, mode scada')
    parser.add_argument('--fast', type=int, default=1000, help='valves at 100 Hz, mode monitor')
    parser.add_argument('--json', type=Path, metavar='FILE', help='write figures here')
    parser.add_argument('--files', type=Path, metavar='FOLDER', help='keep samples and lists here')
    parser.add_argument('--send', help=argparse.SUPPRESS)
    parser.add_argument('--valves', type=int, help=argparse.SUPPRESS)
    parser.add_argument('--folder', type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.send:
        (kind,) = (kind for kind in KINDS if kind.name == options.send)
        send(kind, options.valves, options.seconds, options.folder)
        return
    with tempfile.TemporaryDirectory() as name:
        found = run(options, options.files or Path(name), Path(name))
    text = json.dumps(found, indent=2)
    print(text)
    if options.json:
        options.json.write_text(text + '\n')


if __name__ == '__main__':
    main()
