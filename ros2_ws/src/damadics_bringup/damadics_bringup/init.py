# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `init`: from nothing to the files of a plant."""

import argparse
import math
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from damadics_fd.core.text import NAME as LONGEST
from damadics_fd.core.text import plain
from damadics_fd.ros.arguments import command_parser, split_ros_args
from damadics_fd.store.file_names import file_name
from damadics_fd.store.fleet_file import NAME, read_fleet

EXAMPLES = """examples:
  ros2 run damadics_bringup init my_plant                      asks
  ros2 run damadics_bringup init my_plant --valve LV-101 --valve LV-102
  ros2 run damadics_bringup init my_plant --valve LV-101 --mode scada --simulate"""
MODES = ('monitor', 'scada')
RATES = {'monitor': 200.0, 'scada': 1.0}
MOST_RATE = 10_000.0  # Hz
T = TypeVar('T')


class InitError(ValueError):
    """The files cannot be written; the message says why and what to do."""


@dataclass(frozen=True)
class Plan:
    """What is asked for."""

    folder: Path
    tags: tuple[str, ...]
    mode: str = 'monitor'
    rate: float = 200.0  # Hz
    simulated: bool = False


def valve_name(tag: str) -> str:
    """
    Make the name of a valve out of its tag.

    :param tag: as people at the plant know it.
    :return: small letters, digits and _.
    :raises InitError: where nothing is left.

    >>> valve_name('LV-101'), valve_name('Unit 3/FV 203')
    ('lv_101', 'unit_3_fv_203')
    """
    name = re.sub(r'[^a-z0-9]+', '_', tag.lower()).strip('_')
    if name[:1].isdigit():
        name = f'v_{name}'
    if not NAME.fullmatch(name):
        raise InitError(f'{tag!r} is no tag: give letters and digits, such as LV-101')
    return name


def names_of(tags: Sequence[str]) -> list[str]:
    """
    Make the names of valves out of their tags.

    :param tags: as people at the plant know them.
    :return: names.
    :raises InitError: where one is no tag, or two give one name.
    """
    names = [valve_name(tag) for tag in tags]
    if len(set(names)) < len(names):
        raise InitError(f'two tags give the same name: {", ".join(names)}')
    return names


def fleet_text(plan: Plan) -> str:
    """
    Write the list of valves.

    :param plan: what is asked for.
    :return: YAML.
    """
    lines = [
        '# One entry per valve; its name becomes the namespace (/NAME/measurement).',
        '# parameters: what describes the valve; replace it by what `commission` writes',
        '# settings:   what differs from that file',
        '# simulate:   a simulated plant with --simulate; a valve without it is a real one',
        'valves:',
    ]
    for number, tag in enumerate(plan.tags, 1):
        name = valve_name(tag)
        reference = f'references/{file_name(tag)}'
        lines += [
            f'  {name}:',
            f'    parameters: {name}.param.yaml',
            f'    settings: {{reference: {(plan.folder / reference).absolute()}}}',
        ]
        if plan.simulated:
            lines.append(
                '    simulate: {scenario: random_nominal, model: lugre, '
                f'rate: {plan.rate}, noise: true, seed: {number}}}'
            )
    return '\n'.join(lines) + '\n'


def parameter_text(plan: Plan, tag: str) -> str:
    """
    Write the parameters of one valve.

    :param plan: what is asked for.
    :param tag: of the valve.
    :return: YAML.
    """
    quoted = tag.replace("'", "''")
    return f"""# Parameters of one valve; all that can be set, with units and ranges, is listed by
# `ros2 run damadics_fd settings --list --mode {plan.mode}`.
# `ros2 run damadics_fd commission RECORDING --out {valve_name(tag)}.param.yaml` writes this file
# from a fault-free recording; the values of the data sheet go in with --set.
/**:
  ros__parameters:
    actuator: '{quoted}'
    mode: {plan.mode}
    sample_rate: {plan.rate}
"""


def first_page(plan: Plan) -> str:
    """
    Write what to do next.

    :param plan: what is asked for.
    :return: Markdown.
    """
    name = valve_name(plan.tags[0])
    simulate = ' --simulate' if plan.simulated else ''
    return f"""# What to do next

1. See it: `ros2 run damadics_bringup run fleet.yaml --dashboard{simulate}`, then
   <http://127.0.0.1:8080>.
2. Connect: publish `damadics_msgs/Measurement` on `/{name}/measurement` (1 = closed, pressures in
   Pa, the sampling instant in `header.stamp`), or let `damadics_connect` do it.
3. Commission: record some minutes of the moving, fault-free valve,
   `ros2 run damadics_fd recorder /{name}/measurement --out {name}`, then
   `ros2 run damadics_fd commission {name} --actuator '{plan.tags[0]}' --out {name}.param.yaml`.
4. Watch: start again with the new file; the tile turns green when the valve is learned.
5. Act: docs/operations.md says what alarms mean.
"""


def write(plan: Plan) -> list[Path]:
    """
    Write the files.

    :param plan: what is asked for.
    :return: their paths.
    :raises InitError: where there are such files already, or two valves would have one name.
    """
    names_of(plan.tags)
    files = {'fleet.yaml': fleet_text(plan), 'NEXT.md': first_page(plan)}
    files |= {f'{valve_name(tag)}.param.yaml': parameter_text(plan, tag) for tag in plan.tags}
    present = [name for name in files if (plan.folder / name).exists()]
    if present:
        raise InitError(f'{plan.folder} has {", ".join(present)} already: choose another folder')
    try:
        (plan.folder / 'references').mkdir(parents=True, exist_ok=True)
        for name, text in files.items():
            (plan.folder / name).write_text(text, 'utf-8')
    except OSError as problem:
        raise InitError(f'{plan.folder}: {problem.strerror}: choose another folder') from problem
    read_fleet(plan.folder / 'fleet.yaml')
    return [plan.folder / name for name in files]


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser('init', 'Write the fleet file and a parameter file per valve.', EXAMPLES)
    p.add_argument('folder', type=Path, metavar='FOLDER', help='made where it is missing')
    p.add_argument('--valve', action='append', default=[], metavar='TAG', help='again for more')
    p.add_argument('--mode', choices=MODES, help='monitor: 50 Hz or more with chamber pressure')
    p.add_argument('--rate', type=float, metavar='HZ', help='of the samples')
    p.add_argument('--simulate', action='store_true', help='with a simulated plant each')
    return p


def ask(question: str, default: str, check: Callable[[str], T]) -> T:
    """
    Ask a person, and again where the answer cannot be.

    :param question: what is asked.
    :param default: what an empty answer means.
    :param check: makes a value of the answer; raises InitError.
    :return: the value.
    """
    while True:
        try:
            return check(input(f'{question} [{default}]: ').strip() or default)
        except InitError as problem:
            print(f'  {problem}')


def tags_of(answer: str) -> tuple[str, ...]:
    """
    Read the tags of valves.

    :param answer: tags with blanks or commas between.
    :return: the tags.
    :raises InitError: where one is no tag, or two give one name.
    """
    tags = tuple(answer.replace(',', ' ').split())
    names_of(tags)
    return tags


def mode_of(answer: str) -> str:
    """
    Read a mode.

    :param answer: as typed.
    :return: the mode.
    :raises InitError: where there is no such mode.
    """
    if answer not in MODES:
        raise InitError(f'there is no mode {plain(answer, LONGEST)}: monitor or scada')
    return answer


def rate_of(answer: str) -> float:
    """
    Read a sample rate.

    :param answer: as typed [Hz].
    :return: the rate [Hz].
    :raises InitError: where it is no rate.
    """
    try:
        rate = float(answer.replace(',', '.'))
    except ValueError:
        rate = math.nan
    if not 0.0 < rate <= MOST_RATE:
        raise InitError(f'{plain(answer, LONGEST)} is no rate: give samples a second, more than 0')
    return rate


def yes_of(answer: str) -> bool:
    """
    Read yes or no.

    :param answer: as typed.
    :return: whether it is yes.
    :raises InitError: where it is neither.
    """
    if answer.lower() not in ('y', 'yes', 'n', 'no'):
        raise InitError('answer y or n')
    return answer.lower().startswith('y')


def main(args: list[str] | None = None) -> int:
    """
    Write the files of a plant.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    options = parser().parse_args(split_ros_args(args)[0])
    tags, mode, rate = options.valve, options.mode, options.rate
    simulated = options.simulate
    try:
        if not tags:
            if not sys.stdin.isatty():
                raise InitError('no valve is given: add --valve TAG')
            tags = ask('Tags of the valves, with blanks between', 'LV-101', tags_of)
            mode = mode or ask(
                'Mode: monitor (50 samples a second or more) or scada (about one)',
                'monitor',
                mode_of,
            )
            rate = rate or ask('Samples a second', f'{RATES[mode]:g}', rate_of)
            simulated = simulated or ask('Simulated plants to try it with (y, n)', 'n', yes_of)
        mode = mode or 'monitor'
        rate = RATES[mode] if rate is None else rate_of(f'{rate}')
        tags = tuple(plain(tag, LONGEST) for tag in tags)
        written = write(Plan(options.folder, tags, mode, rate, simulated))
    except InitError as problem:
        print(f'init: {problem}', file=sys.stderr)
        return 2
    except (EOFError, KeyboardInterrupt):
        print('\ninit: nothing was written', file=sys.stderr)
        return 130
    for path in written:
        print(path)
    more = ' --simulate' if simulated else ''
    print(f'next: ros2 run damadics_bringup run {written[0]} --dashboard{more}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
