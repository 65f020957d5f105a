# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What can be told of recordings before anything is fitted: units, directions, dead signals."""

from collections.abc import Sequence

import numpy as np

from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.commands.commission.signals import NEEDED, Blocks
from damadics_fd.core.record import Floats
from damadics_fd.core.result import Columns
from damadics_fd.core.settings import Settings
from damadics_fd.core.settings.identified import FaultFree

TRAVEL = 0.2  # of the stroke, at least
CLEARLY, STRONGLY = 0.2, 0.5  # correlation from which a direction counts
ROOM = 0.95  # of a range that may be used
FROZEN = 0.9  # share of equal neighbours beyond which a pressure is frozen


def check_units(columns: Columns) -> None:
    """
    Refuse percent for fractions and bar or MPa for Pa.

    :param columns: a recording.
    :raises CommissioningError: naming every signal that is off.
    """
    wrong = []
    for name in NEEDED:
        values = np.asarray(columns.get(name, ()), float)
        values = values[np.isfinite(values)]
        if not len(values):
            wrong.append(
                f'{name} is not measured: mode monitor needs {", ".join(NEEDED)}; '
                'without the pressures take --mode scada'
            )
            continue
        top = float(np.percentile(np.abs(values), 99.0))
        if name in ('cv', 'x1') and top > 1.5:
            wrong.append(
                f'{name} reaches {top:.3g}: percent? give a fraction: --map {name}=SOURCE*0.01'
            )
        if name in ('p1', 'p2', 'ps') and 0.0 < top < 2e3:
            unit = 'MPa' if top < 5.0 and name != 'ps' else 'bar or kPa'
            wrong.append(
                f'{name} reaches only {top:.3g}: {unit}? give Pa: --map {name}=SOURCE*FACTOR'
            )
    if wrong:
        raise CommissioningError('; '.join(wrong))


def check_directions(b: Blocks, flow: Floats | None) -> None:
    """
    Refuse an inverted command or position.

    The stem moves towards its command: its velocity goes with cv - x1, whatever the two do
    together at one instant. Where it follows without error, they go together.

    :param b: blocks of the whole recording.
    :param flow: of the blocks, where it is measured.
    :raises CommissioningError: where one of them is inverted, saying which if that shows.
    """
    travel = float(np.ptp(b.x)) if len(b.x) else 0.0
    if travel < TRAVEL:
        raise CommissioningError(
            f'the stem moves only {travel:.2f} of its stroke: move the valve through '
            f'{TRAVEL:g} or more, both ways'
        )
    use = np.isfinite(b.v)
    towards = _correlation(b.cv[use] - b.x[use], b.v[use])
    together = _correlation(b.cv, b.x)
    if towards > -CLEARLY and not (towards < CLEARLY and together < -STRONGLY):
        return
    which = 'one of them is inverted'
    if flow is not None and np.isfinite(flow).sum() > 10:
        good = np.isfinite(flow)
        r = _correlation(flow[good], b.x[good])
        if abs(r) > CLEARLY:
            which = f'{"x1" if r > 0.0 else "cv"} is inverted, as the flow shows'
    raise CommissioningError(
        f'x1 moves away from cv: {which}; 1 must mean closed in both (--map x1=1-SOURCE)'
    )


def _correlation(a: Floats, b: Floats) -> float:
    if np.ptp(a) == 0.0 or np.ptp(b) == 0.0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


def dead_signals(recordings: Sequence[FaultFree]) -> list[str]:
    """
    Name the pressures that are constants or frozen.

    :param recordings: of the valve.
    :return: a sentence for each.
    """
    found = []
    for name in ('p1', 'p2', 'ps'):
        values = np.concatenate([np.asarray(r.columns[name], float) for r in recordings])
        values = values[np.isfinite(values)]
        if len(values) < 2:
            continue
        if np.ptp(values) == 0.0:
            found.append(f'{name} is the constant {values[0]:g} Pa: it is not measured')
        elif name == 'ps' and float(np.mean(np.diff(values) == 0.0)) > FROZEN:
            found.append(f'{name} is frozen most of the time: check its transmitter')
    return found


def ranges(recordings: Sequence[FaultFree], s: Settings) -> dict[str, float]:
    """
    Return the ranges of pressures that the valve needs and the settings do not give.

    :param recordings: of the valve.
    :param s: settings with p_max and ps_max.
    :return: settings to change, by name.
    """
    top = {
        name: max(float(np.nanpercentile(r.columns[name], 99.9)) for r in recordings)
        for name in ('p1', 'p2', 'ps')
    }
    wanted = {'p_max': max(top['p1'], top['p2']), 'ps_max': top['ps']}
    return {
        name: float(f'{1.25 * value:.2g}')
        for name, value in wanted.items()
        if value > ROOM * getattr(s, name)
    }
