# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
What a fleet costs on this machine, and whether a sample is lost on the way.

Simulated plants, estimators and detectors of all valves as processes over DDS, the page served
and open in a browser. Every sample is counted where it is sent, where the estimator takes it and
where the detector judges it.

    python benchmarks/bench_fleet.py --valves 10 --rate 200 --seconds 60

With --json instead: what process `fleet`, joined monitors and the compiled loops cost, as ratios
of one run (`many_valves.py` says how).

    python benchmarks/bench_fleet.py --json fleet.json

Joined monitors are compared with nodes apart, or with those of another version of the project:

    git worktree add ../version_0.1 c2c9fd2^ && make -C ../version_0.1 build
    python benchmarks/bench_fleet.py --json fleet.json --before ../version_0.1
"""

import argparse
import json
import os
import re
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

import many_valves
import rclpy
from damadics_bringup.launcher import Task, tasks_of
from damadics_bringup.processes import Processes, free_domain, surroundings
from damadics_fd.ros import qos
from damadics_fd.store.fleet_file import Valve
from damadics_msgs.msg import FaultFlag
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.qos import QoSProfile
from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))
import website
from conftest import free_port

TICKS = os.sysconf('SC_CLK_TCK')
WARM_UP = 5.0  # s after the first sample before CPU time is measured
PATIENCE = 60.0  # s that the plants may take longer than their scenario
LAST_WORDS = 2.5  # s from the last sample to the last diagnostics


class Counts:
    """Keeps what the nodes say of themselves on /diagnostics."""

    def __init__(self, domain: int, valves: list[str]) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node('bench', context=self.context)
        self.executor = EventsExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.values: dict[str, dict[str, str]] = defaultdict(dict)
        self.flags: set[str] = set()
        self.node.create_subscription(
            DiagnosticArray, '/diagnostics', self._take, QoSProfile(depth=1000)
        )
        for valve in valves:
            self.node.create_subscription(
                FaultFlag, f'/{valve}/fault_flag', lambda _, v=valve: self.flags.add(v), qos.FLAG
            )

    def _take(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.values[status.name.partition(':')[0]] = {v.key: v.value for v in status.values}

    def spin(self, seconds: float) -> None:
        """Take messages for a while."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self.executor.spin_once(timeout_sec=min(left, 0.1))

    def close(self) -> None:
        """Leave the graph."""
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


def cpu(pid: int) -> float:
    """Return the CPU time of a process [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def browser_processes() -> list[int]:
    """Return the processes of the browser that this program has started."""
    found = []
    for folder in Path('/proc').glob('[0-9]*'):
        try:
            words = (folder / 'cmdline').read_bytes().split(b'\0')
        except OSError:
            continue
        if Path(os.fsdecode(words[0].partition(b' ')[0])).name.startswith('chrom'):
            found.append(int(folder.name))
    return found


def cpu_times(kinds: dict[str, list[int]]) -> dict[str, float]:
    return {
        kind: sum(cpu(pid) for pid in pids if Path(f'/proc/{pid}').exists())
        for kind, pids in kinds.items()
    }


def measure(options: argparse.Namespace, folder: Path) -> None:
    valves = [
        Valve(
            f'lv{n:03d}',
            settings={'sample_rate': options.rate, 'actuator': f'LV-{n}', 'alarm_folder': ''},
            simulate={
                'scenario': 'random_nominal',
                'model': 'lugre',
                'rate': options.rate,
                'noise': True,
                'seed': n,
                'duration': options.seconds,
                'wait_for_subscribers': 2,
            },
        )
        for n in range(1, options.valves + 1)
    ]
    port = free_port()
    tasks = tasks_of(
        valves,
        argparse.Namespace(
            record=None,
            dashboard=True,
            simulate=True,
            port=port,
            host='127.0.0.1',
            show=False,
            processes=options.processes,
        ),
    )
    domain = free_domain()
    environment = {**surroundings(domain), 'XDG_STATE_HOME': str(folder / 'state')}
    with Processes(folder / 'logs', environment) as processes, website.browser() as chromium:
        counts = Counts(domain, [valve.name for valve in valves])
        kinds: dict[str, list[int]] = defaultdict(list)

        def start(task: Task) -> None:
            processes.start(task.package, task.executable, task.arguments, task.label)
            kinds[task.executable].append(processes.pid(task.label))

        for task in tasks:
            if task.executable != 'plant':
                start(task)
        while len(counts.flags) < len(valves):
            counts.spin(0.2)
            processes.check()
        website.wait_until_served(f'http://127.0.0.1:{port}')
        page = None
        if chromium:
            page = chromium.new_page(viewport={'width': 1440, 'height': 960})
            page.goto(f'http://127.0.0.1:{port}')
            page.wait_for_selector(f'[data-valve={valves[0].name}]')
            page.goto(f'http://127.0.0.1:{port}/valve/{valves[0].name}')
            page.wait_for_selector('canvas')
        plants = [task for task in tasks if task.executable == 'plant']
        for task in plants:
            start(task)
        while any(
            counts.values[f'{v.name}/detector'].get('Estimates judged', '0') == '0' for v in valves
        ):
            counts.spin(0.2)
        if chromium:
            kinds['browser'] = browser_processes()
        counts.spin(WARM_UP)
        began, before = time.monotonic(), cpu_times(kinds)
        shown = page.evaluate('damadics.messages') if page else 0
        counts.spin(options.seconds / 2.0)
        if any(processes.ended(task.label) for task in plants):
            raise SystemExit('the plants ended while CPU time was measured: more --seconds')
        span = time.monotonic() - began
        used = {kind: value - before[kind] for kind, value in cpu_times(kinds).items()}
        updates = (page.evaluate('damadics.messages') - shown) / span if page else 0.0
        deadline = time.monotonic() + options.seconds + PATIENCE
        while late := [task.label for task in plants if not processes.ended(task.label)]:
            counts.spin(0.5)
            if time.monotonic() > deadline:
                raise SystemExit(
                    f'{", ".join(late)} did not end; the last words of the first:\n'
                    + processes.log(late[0]).read_text()[-1000:]
                )
        counts.spin(LAST_WORDS)
        report(valves, kinds, used, span, counts, processes, updates)
        counts.close()


def report(valves, kinds, used, span, counts, processes, updates) -> None:
    console = Console(width=100)
    costs = Table(title=f'CPU over {span:.0f} s, % of one core', title_justify='left')
    for head in ('process', 'number', 'each', 'all'):
        costs.add_column(head, justify='left' if head == 'process' else 'right')
    for kind, pids in kinds.items():
        share = 100.0 * used[kind] / span
        costs.add_row(kind, str(len(pids)), f'{share / len(pids):.1f}', f'{share:.0f}')
    costs.add_row('all', '', '', f'{100.0 * sum(used.values()) / span:.0f}')
    console.print(costs)
    samples = Table(title='Samples', title_justify='left')
    for head in ('valve', 'sent', 'taken', 'judged', 'lost'):
        samples.add_column(head, justify='left' if head == 'valve' else 'right')
    total = [0, 0, 0]
    for valve in valves:
        words = processes.log(f'{valve.name}/plant').read_text()
        sent = int(re.search(r'ended after (\d+) samples', words)[1])
        taken = int(counts.values[f'{valve.name}/estimator']['Samples accepted'])
        judged = int(counts.values[f'{valve.name}/detector']['Estimates judged'])
        samples.add_row(valve.name, str(sent), str(taken), str(judged), str(sent - judged))
        total = [a + b for a, b in zip(total, (sent, taken, judged), strict=True)]
        if 'does not reach' in words:
            console.print(f'{valve.name}: the plant did not keep its pace')
    samples.add_row('all', *map(str, total), str(total[0] - total[2]))
    console.print(samples)
    console.print(f'the open page: {updates:.1f} updates of the plots a second')


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--valves', type=int, default=10)
    parser.add_argument('--rate', type=float, default=200.0, help='samples per second [Hz]')
    parser.add_argument(
        '--processes',
        type=int,
        default=0,
        metavar='N',
        help='all estimators and detectors in N processes; 0: each in its own',
    )
    parser.add_argument('--seconds', type=float, default=60.0, help='length of the run [s]')
    parser.add_argument(
        '--json', type=Path, metavar='FILE', help='measure many valves instead, write figures here'
    )
    parser.add_argument(
        '--before',
        type=lambda text: Path(text).absolute(),
        metavar='FOLDER',
        help='with --json: compare joined monitors with the version that is built here',
    )
    options = parser.parse_args()
    if options.before and not (options.before / 'ros2_ws/install/damadics_fd').is_dir():
        parser.error(f'{options.before} is not built: make -C {options.before} build')
    with tempfile.TemporaryDirectory() as folder:
        if options.json:
            os.environ.update(surroundings(free_domain()), XDG_STATE_HOME=f'{folder}/state')
            found = many_valves.figures(Path(folder), options.before)
            options.json.write_text(json.dumps(found, indent=2) + '\n')
            for name, value in found.items():
                print(f'{name:28s} {value:12.4g}')
        else:
            measure(options, Path(folder))


if __name__ == '__main__':
    main()
