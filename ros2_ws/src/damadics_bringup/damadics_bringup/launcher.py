# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `run`: what the launch files do, on a machine without ROS 2's launch."""

import argparse
import os
import signal
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from damadics_fd.core.record import Saved
from damadics_fd.ros.arguments import command_parser, state_folder
from damadics_fd.start import missing_middleware
from damadics_fd.store.access import AccessError
from damadics_fd.store.fleet_file import FleetError, Valve, read_fleet
from damadics_fd.store.slots import check_folder

from damadics_bringup.fleet import MONITORS, simulated, spread
from damadics_bringup.keeper import USAGE, Keeper, Task
from damadics_bringup.page_options import check_page, port
from damadics_bringup.processes import ProcessError, Processes, assignments

EXAMPLES = """examples:
  ros2 run damadics_bringup run --simulate --dashboard     one simulated valve and the web page
  ros2 run damadics_bringup run fleet.yaml --dashboard     your valves
  ros2 run damadics_bringup run fleet.yaml --record bags/today"""
DEMO = Path(get_package_share_directory('damadics_bringup')) / 'config' / 'demo_valve.yaml'
LOOK = 0.2  # s between two looks at the processes
END = {
    'recorder': 60.0,
    'monitors': 60.0,
    'fleet': 60.0,
}  # s to write what it has, to take leave of DDS for many
NAMED = 8  # valves whose names are printed
FOREVER = 1e8  # s of simulated time


def arguments_of(
    parameters: Saved,
    *,
    namespace: str = '',
    file: Path | None = None,
    topics: dict[str, str] | None = None,
    enclave: str = '',
) -> list[str]:
    """
    Write a node's command line.

    :param parameters: by name.
    :param namespace: of the node, without leading slash.
    :param file: parameter file, read before the parameters.
    :param topics: new name by name.
    :param enclave: of SROS 2; without security it does nothing.
    :return: arguments.

    >>> arguments_of({'noise': True}, namespace='lv101')
    ['--ros-args', '-r', '__ns:=/lv101', '-p', 'noise:=true']
    """
    words = ['--ros-args']
    if enclave:
        words += ['--enclave', enclave]
    if namespace:
        words += ['-r', f'__ns:=/{namespace}']
    for old, new in (topics or {}).items():
        words += ['-r', f'{old}:={new}']
    if file:
        words += ['--params-file', str(file)]
    return words + assignments(parameters)


def signatures(valves: Sequence[Valve]) -> list[str]:
    """
    List the folders of signatures and trends that a fleet file states.

    :param valves: of the fleet.
    :return: each once; "auto" and none are left out.
    """
    stated = (str(valve.settings.get('signature_folder') or 'auto') for valve in valves)
    return [folder for folder in dict.fromkeys(stated) if folder != 'auto']


def causes(valves: Sequence[Valve]) -> list[str]:
    """
    Return the file of edited texts that the valves of a fleet file share, for the page.

    :param valves: of the fleet.
    :return: its path; nothing where there is none, or more than one.
    """
    stated = {str(valve.settings.get('causes_file') or '') for valve in valves} - {''}
    return list(stated) if len(stated) == 1 else []


def tasks_of(valves: list[Valve], options: argparse.Namespace) -> list[Task]:
    """
    List what has to run.

    :param valves: the fleet.
    :param options: the command line.
    :return: tasks, the consumers of samples before the plants.
    """
    tasks = []
    if options.record:
        tasks.append(
            Task(
                'recorder',
                'damadics_fd',
                'recorder',
                ['--all', '--out', str(options.record), *arguments_of({}, enclave='/recorder')],
            )
        )
    tasks += (
        [_fleet(valves, options)]
        if getattr(options, 'blocks', False)
        else _together(valves, options.processes)
        if options.processes
        else [
            Task(
                f'{valve.name}/{node}',
                'damadics_fd',
                node,
                node_arguments(valve, node, f'/{valve.name}/{node}'),
            )
            for valve in valves
            for node in MONITORS
        ]
    )
    if options.dashboard:
        tasks.append(
            Task(
                'dashboard',
                'damadics_dashboard',
                'dashboard',
                ['--port', str(options.port), '--host', options.host]
                + (['--show'] if options.show else [])
                + (['--token-file', str(options.token_file)] if options.token_file else [])
                + [word for folder in signatures(valves) for word in ('--signatures', folder)]
                + [word for file in causes(valves) for word in ('--causes', file)]
                + arguments_of({}, enclave='/dashboard'),
            )
        )
    if options.simulate:
        tasks += [
            Task(
                f'{valve.name}/plant',
                'damadics_plant',
                'plant',
                arguments_of(
                    {
                        'duration': FOREVER,
                        'wait_for_subscribers': 1 + bool(options.record),
                        'actuator': valve.settings.get('actuator', valve.name),
                        **valve.simulate,
                    },
                    namespace=valve.name,
                    topics=dict(valve.topics),
                    enclave=f'/{valve.name}/plant',
                ),
            )
            for valve in simulated(valves)
        ]
    return tasks


def node_arguments(valve: Valve, node: str, enclave: str) -> list[str]:
    """
    Write the command line of a monitoring node.

    :param valve: what it monitors.
    :param node: `estimator` or `detector`.
    :param enclave: of SROS 2.
    :return: arguments.
    """
    return arguments_of(
        valve.settings_of(node),
        namespace=valve.name,
        file=valve.parameters,
        topics=dict(valve.topics),
        enclave=enclave,
    )


def arguments_of_all(valves: list[Valve], enclave: str) -> list[str]:
    """
    Write the command line of a process that monitors several valves.

    :param valves: what it monitors.
    :param enclave: of SROS 2.
    :return: arguments of `monitors`.
    """
    words: list[str] = []
    for valve in valves:
        for node in MONITORS:
            words += ['--', node, *node_arguments(valve, node, enclave)]
    return words[1:]


def _together(valves: list[Valve], processes: int) -> list[Task]:
    return [
        Task(name, 'damadics_fd', 'monitors', arguments_of_all(group, f'/{name}'))
        for name, group in spread(valves, processes).items()
    ]


def _fleet(valves: list[Valve], options: argparse.Namespace) -> Task:
    """Return the one process that takes blocks; simulated plants send valve by valve."""
    exposed: Saved = {'expose': len(valves)} if options.simulate else {}
    words = [str(options.fleet or DEMO), *arguments_of(exposed, enclave='/fleet')]
    return Task('fleet', 'damadics_fd', 'fleet', words)


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser(
        'run', 'Start estimator and detector of every valve and keep them running.', EXAMPLES
    )
    p.add_argument(
        'fleet',
        nargs='?',
        type=Path,
        help='list of the valves (YAML); default: one valve for a first look',
    )
    p.add_argument(
        '--simulate', action='store_true', help='start the plants that the fleet file describes'
    )
    p.add_argument('--dashboard', action='store_true', help='start the web page')
    p.add_argument('--show', action='store_true', help='open the web page in a browser')
    p.add_argument('--host', default='127.0.0.1', help='address of the web page (127.0.0.1)')
    p.add_argument('--port', type=port, default=8080, help='port of the web page (8080)')
    p.add_argument(
        '--token-file',
        type=Path,
        metavar='FILE',
        help='tokens that other machines must show to the web page',
    )
    p.add_argument('--record', type=Path, metavar='DIR', help='record all topics into this bag')
    p.add_argument(
        '--processes',
        type=int,
        default=0,
        metavar='N',
        help='run all estimators and detectors in N processes, at most half the cost '
        'of one process each (the default)',
    )
    p.add_argument(
        '--blocks',
        action='store_true',
        help='run the node fleet instead, which judges all valves of the list in one process '
        'and takes measurement_block',
    )
    p.add_argument(
        '--logs',
        type=Path,
        default=state_folder() / 'logs',
        metavar='DIR',
        help='where the output of every process goes (%(default)s)',
    )
    p.add_argument('--for', dest='seconds', type=float, metavar='S', help='end after so long [s]')
    return p


def greeting(valves: list[Valve], options: argparse.Namespace) -> str:
    """
    Say what is being started.

    :param valves: the fleet.
    :param options: the command line.
    :return: lines of text.
    """
    names = [valve.name for valve in valves[:NAMED]] + ['...'] * (len(valves) > NAMED)
    lines = [
        f'{len(valves)} valve(s): {", ".join(names)}; logs in {options.logs}; '
        'Ctrl-C ends all, a second one at once'
    ]
    cores = os.cpu_count() or 1
    if not (options.processes or options.blocks) and len(valves) > cores:
        lines.append(
            f'{2 * len(valves)} processes monitor them on {cores} cores: '
            f'--processes {cores} does it at half the cost'
        )
    if options.dashboard:
        lines.append(f'The dashboard opens at http://{options.host}:{options.port}')
    return '\n'.join(lines)


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the fleet until a signal comes.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    options = parser().parse_args(args)
    options.dashboard = options.dashboard or options.show
    stop: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN or number != signal.SIGHUP:  # nohup
            signal.signal(number, lambda signum, frame: stop.append(signum))
    try:
        if options.blocks and options.processes:
            raise FleetError('--blocks is one process: leave out --processes')
        if options.processes < 0:
            raise FleetError(
                '--processes: give a number of processes from 1, such as the cores of this machine'
            )
        if options.dashboard:
            check_page(options.host, options.port, options.token_file)
        problem = missing_middleware() or (options.record and check_folder(options.record.parent))
        if problem:
            raise FleetError(problem)
        valves = read_fleet(options.fleet or DEMO)
        tasks = tasks_of(valves, options)
        with Processes(options.logs) as processes:
            keeper = Keeper(processes, tasks)
            print(greeting(valves, options), flush=True)
            end = time.monotonic() + (options.seconds or 1e9)
            while not stop and time.monotonic() < end and not keeper.hopeless:
                time.sleep(LOOK)
                keeper.look()
            signals = len(stop)
            patience = {t.label: END[t.executable] for t in tasks if t.executable in END}
            killed = processes.end_all(patient_with=patience, hurry=lambda: len(stop) > signals)
            if killed:
                print(f'run: killed, as they did not end: {", ".join(killed)}', file=sys.stderr)
    except (FleetError, AccessError) as problem:
        print(f'run: {problem}', file=sys.stderr)
        return USAGE
    except (ProcessError, OSError) as problem:
        print(f'run: {problem}', file=sys.stderr)
        return 1
    return USAGE if keeper.refused else 0


if __name__ == '__main__':
    sys.exit(main())
