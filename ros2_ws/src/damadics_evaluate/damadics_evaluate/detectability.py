# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What will be found on a valve of your own: its twin with faults of growing size."""

import argparse
import csv
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from damadics_fd.core.decision.alarm import RAISED
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.state import CAUSES
from damadics_plant import Fault, Scenario, simulate
from damadics_plant.actuator.parameters import LuGreActuator
from damadics_plant.actuator.twin import parts_of, read_twin
from damadics_plant.scenarios.sources import RandomSteps, Sine

QUIET, AFTER = 240.0, 300.0  # s before and after the onset
FRICTION = (-0.5, 0.3, 0.5, 1.0, 3.0)  # shares of the friction
SPRING = (-0.2, -0.05, -0.02, 0.02, 0.05)  # and of the stiffness
FULL = 20.0  # times the friction, that fault f4 adds at strength 1
OPERATION = {  # of a twin that does not tell its own: the benchmark's pressures, good transmitters
    'p1': 3.5e6,
    'p1_swing': 7e4,
    'p2': 2.6e6,
    'p2_swing': 2.6e4,
    'x1_noise': 5e-4,
    'ps_noise': 150.0,
    'p1_noise': 2e3,
    'p2_noise': 2e3,
}
RATE = 200.0


@dataclass(frozen=True)
class Row:
    """Hold what became of one fault on one seed."""

    quantity: str
    change: float
    seed: int
    false_alarms: int
    delay: float  # [s] since the onset; NaN where it was not found
    cause: str
    size: float


@dataclass(frozen=True)
class Valve:
    """Hold what commission found of a valve."""

    actuator: LuGreActuator
    settings: Settings  # of the monitor
    operation: dict[str, float]  # see OPERATION


def add_parser(commands: 'argparse._SubParsersAction[argparse.ArgumentParser]') -> None:
    """
    Add the command.

    :param commands: of `evaluate`.
    """
    parser = commands.add_parser(
        'detectability', help='faults of growing size on the twin of a valve'
    )
    parser.add_argument('valve', type=Path, help='file of the valve, or twin, of commission')
    parser.add_argument('--seeds', type=int, default=2, metavar='N', help='runs per fault (2)')
    parser.add_argument('--csv', type=Path, metavar='FILE', help='write all rows here')
    parser.add_argument('--plot', type=Path, metavar='FILE', help='draw the curve (PNG)')


def detectability(arguments: argparse.Namespace) -> int:
    """
    Run the command.

    :param arguments: parsed.
    :return: 0.
    :raises ValueError: where the file is no twin.
    """
    rows = list(study(read_valve(arguments.valve), arguments.seeds))
    print(f'{"change":>18}  found  delay, median [s]  named')
    for quantity, change in dict.fromkeys((row.quantity, row.change) for row in rows):
        group = [row for row in rows if (row.quantity, row.change) == (quantity, change)]
        found = [row.delay for row in group if np.isfinite(row.delay)]
        delay = f'{np.median(found):.1f}' if found else '-'
        named = ', '.join(sorted({row.cause for row in group}))
        print(
            f'{quantity:>10} {100 * change:+6.0f} %  {len(found)}/{len(group)}'
            f'  {delay:>17}  {named}'
        )
    print(f'false alarms before the faults: {sum(row.false_alarms for row in rows)}')
    if arguments.csv:
        with arguments.csv.open('w', newline='', encoding='utf-8') as file:
            writer = csv.DictWriter(file, [field.name for field in fields(Row)])
            writer.writeheader()
            writer.writerows(asdict(row) for row in rows)
    if arguments.plot:
        draw(rows, arguments.plot)
    return 0


def read_valve(path: Path) -> Valve:
    """
    Read what commission found of a valve.

    :param path: of the twin.
    :return: the valve.
    :raises ValueError: naming what is wrong.
    """
    actuator, parts = read_twin(path), parts_of(path)
    operation, wrong = dict(OPERATION), []
    for name, value in parts['operation'].items():
        if name in OPERATION and isinstance(value, (int, float)) and 0.0 <= value < 1e9:
            operation[name] = float(value)
        else:
            wrong.append(name)
    if wrong:
        raise ValueError(f'{path}: wrong in its part operation: {", ".join(wrong)}')
    return Valve(actuator, Settings.for_mode('monitor', **parts['settings']), operation)


def study(valve: Valve, seeds: int) -> Iterator[Row]:
    """
    Run the twin with every fault.

    :param valve: the valve.
    :param seeds: runs per fault.
    :return: a row for each run.
    """
    for quantity, changes in (('friction', FRICTION), ('spring', SPRING)):
        for change in changes:
            for seed in range(seeds):
                yield trial(valve, quantity, change, seed)


def trial(valve: Valve, quantity: str, change: float, seed: int) -> Row:
    """
    Run the twin with one fault as a step.

    :param valve: the valve.
    :param quantity: friction or spring.
    :param change: share of it.
    :param seed: of command and noise.
    :return: what became of it.
    """
    o = valve.operation
    key, strength = ('f4', change / FULL if change > 0.0 else change)
    if quantity == 'spring':
        key, strength = 'f11', change
    scenario = Scenario(
        name='detectability',
        duration=QUIET + AFTER,
        cv=RandomSteps(seed=seed),
        p1=Sine(o['p1'], o['p1_swing'], 0.1),
        p2=Sine(o['p2'], o['p2_swing'], 0.3),
        faults=(Fault(key, strength, QUIET),),
    )
    result = simulate(scenario, rate=RATE, model=valve.actuator, seed=seed)
    rng = np.random.default_rng(seed)
    columns = {name: np.array(result[name]) for name in ('cv', 'x1', 'p1', 'p2', 'ps')}
    n = len(columns['x1'])
    for name in ('x1', 'ps', 'p1', 'p2'):
        columns[name] = columns[name] + o[f'{name}_noise'] * rng.standard_normal(n)
    stamp = np.round(np.arange(n) / RATE * 1e9).astype(np.int64)
    judged = run({'stamp': stamp, **columns}, valve.settings.replace(sample_rate=RATE))
    raised = [e.stamp * 1e-9 for e in judged.events if e.transition == RAISED]
    later = [t - QUIET for t in raised if t >= QUIET]
    last = judged.decisions[-1]
    return Row(
        quantity,
        change,
        seed,
        sum(t < QUIET for t in raised),
        later[0] if later else float('nan'),
        CAUSES[int(last['cause'])],
        float(last['strength']),
    )


def draw(rows: list[Row], path: Path) -> None:
    """
    Draw the delay over the size of the change.

    :param rows: of the study.
    :param path: of the PNG.
    """
    from matplotlib.figure import Figure  # slow to import, needed here only

    figure = Figure(figsize=(9.0, 4.0), layout='constrained')
    for axis, quantity in zip(figure.subplots(1, 2), ('friction', 'spring'), strict=True):
        group = [row for row in rows if row.quantity == quantity]
        x = np.array([100.0 * abs(row.change) for row in group])
        y = np.array([row.delay for row in group])
        for up, label, mark in ((True, 'increase', '^'), (False, 'decrease', 'v')):
            side = np.array([(row.change > 0.0) == up for row in group], bool)
            axis.loglog(x[side], np.maximum(y[side], 0.1), mark, label=label)
            missed = side & ~np.isfinite(y)
            axis.loglog(x[missed], np.full(missed.sum(), AFTER), mark, mfc='none', color='0.5')
        axis.set(title=quantity, xlabel='change [%]', ylabel='delay [s]; open: not found')
        sizes = sorted(set(x.tolist()))
        axis.set_xticks(sizes, [f'{size:g}' for size in sizes])  # and no powers of ten between
        axis.set_xticks([], minor=True)
        axis.set_ylim(0.07, 1.5 * AFTER)
        axis.yaxis.set_major_formatter('{x:g}')
        axis.yaxis.set_minor_formatter('')
        axis.grid(alpha=0.3)
        axis.legend()
    figure.savefig(path, dpi=110)
