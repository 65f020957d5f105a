# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Show what the paper's method decides from which start: passes of the fault-free experiment, or b1.

    python -m damadics_evaluate.campaigns.paper_start --figure docs/images/paper_start.png

A pass is the paper's fault-free experiment (120 s) with the adaptive laws running, from what the
pass before has learned. The alternative is zero weights with an initial bound b1.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
from damadics_fd.core.monitor import Chain
from damadics_fd.core.record import Plain
from damadics_fd.core.result import Columns
from damadics_fd.core.settings import Settings
from damadics_plant import simulate
from matplotlib.axes import Axes

PAPER = Settings.for_mode('paper')
ONSET = 70.0  # s
PASSES = range(9)
BOUNDS = np.round(np.arange(0.0, 6.01, 0.05), 2)  # 1/s2
EXPERIMENTS = ('nominal', 'friction', 'spring')
Learned = Mapping[str, Plain]


class Start(NamedTuple):
    """What is decided from one start."""

    where: float  # number of passes, or b1 [1/s2]
    nominal: int  # decisions in the fault-free run
    before: int  # decisions before the fault, friction and spring together
    friction: float | None  # when the friction fault is decided [s]
    spring: float | None  # when the spring fault is decided [s]


def decided(columns: Columns, learned: Learned | None) -> list[float]:
    chain = Chain(PAPER).starting_from(learned)
    return [event.stamp * 1e-9 for event in chain.events(columns)]


def first(instants: list[float]) -> float | None:
    return next((round(t, 4) for t in instants if t >= ONSET), None)


def judge(where: float, data: Mapping[str, Columns], learned: Learned | None) -> Start:
    instants = {}
    for name in EXPERIMENTS:
        result = Chain(PAPER).starting_from(learned).run(data[name])
        instants[name] = [event.stamp * 1e-9 for event in result.detections]
    faulty = instants['friction'] + instants['spring']
    return Start(
        where,
        len(instants['nominal']),
        sum(t < ONSET for t in faulty),
        first(instants['friction']),
        first(instants['spring']),
    )


def after_passes(data: Mapping[str, Columns]) -> list[Start]:
    starts, learned = [], None
    for number in PASSES:
        starts.append(judge(number, data, learned))
        chain = Chain(PAPER).starting_from(learned)
        chain.run(data['nominal'])
        learned = chain.learned()
    return starts


def with_bounds(data: Mapping[str, Columns]) -> list[Start]:
    chain = Chain(PAPER)
    chain.run({name: column[:1] for name, column in data['nominal'].items()})
    zero = chain.learned()
    return [judge(float(b1), data, {**zero, 'b1': float(b1)}) for b1 in BOUNDS]


def draw(axes: Axes, starts: list[Start], label: str) -> None:
    where = [start.where for start in starts]
    axes.step(where, [s.nominal for s in starts], where='mid', label='fault-free run')
    axes.step(where, [s.before / 2 for s in starts], where='mid', ls='--', label='before a fault')
    good = [s for s in starts if not s.nominal and not s.before and s.friction and s.spring]
    masked = [s.where for s in starts if s.friction is None or s.spring is None]
    half = (where[1] - where[0]) / 2
    if good:
        axes.axvspan(good[0].where - half, good[-1].where + half, color='tab:green', alpha=0.15)
        axes.text(
            (good[0].where + good[-1].where) / 2,
            4.6,
            'only the faults\nare decided',
            ha='center',
            color='tab:green',
        )
    if masked:
        axes.axvspan(masked[0] - half, where[-1] + half, color='tab:red', alpha=0.1)
        axes.text(
            (masked[0] - half + where[-1] + half) / 2,
            2.6,
            'the friction fault\nis masked',
            ha='center',
            color='tab:red',
        )
    axes.set(xlabel=label, xlim=(where[0] - half, where[-1] + half), ylim=(-0.2, 6.5))
    axes.spines[['top', 'right']].set_visible(False)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--figure', type=Path, help='draw decisions against start')
    parser.add_argument('--out', type=Path, help='write all figures as JSON')
    options = parser.parse_args()
    data = {name: simulate(f'paper_{name}', rate=400.0).columns for name in EXPERIMENTS}
    passes, bounds = after_passes(data), with_bounds(data)
    for start in passes:
        print(start)
    good = [s.where for s in bounds if not s.nominal and not s.before and s.friction and s.spring]
    print(f'b1 with decisions after the faults only: {min(good)} to {max(good)} 1/s2')
    if options.out:
        content = {'passes': [s._asdict() for s in passes], 'b1': [s._asdict() for s in bounds]}
        options.out.write_text(json.dumps(content, indent=1) + '\n')
    if options.figure:
        figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), sharey=True)
        draw(left, passes, 'passes of the fault-free experiment learned before')
        draw(right, bounds, r'initial $b_1$ in 1/s$^2$, other weights zero')
        left.set_ylabel('decisions without a fault')
        figure.legend(
            *left.get_legend_handles_labels(), loc='upper center', ncols=2, frameon=False
        )
        figure.tight_layout(rect=(0, 0, 1, 0.93))
        figure.savefig(options.figure, dpi=110)


if __name__ == '__main__':
    main()
