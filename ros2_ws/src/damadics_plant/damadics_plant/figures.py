# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Draw the pictures of the README: the step response, and what each fault does."""

import argparse
import io
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from damadics_plant.faults.catalogue import CATALOGUE, Fault
from damadics_plant.run import Run
from damadics_plant.scenarios.library import load_scenario
from damadics_plant.scenarios.scenario import Scenario
from damadics_plant.scenarios.sources import Steps
from damadics_plant.simulator import simulate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NOMINAL, FAULTY, LUGRE, SET_POINT = '#9aa0a6', '#d1495b', '#2e6f95', '#2b2d42'
FLOW, CHAMBER = '#e09f3e', '#7b5ea7'
_STYLE: dict[Any, Any] = {
    'font.size': 9,
    'axes.titlesize': 9,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'grid.color': '#eceff1',
    'lines.linewidth': 1.3,
    'svg.hashsalt': 'plant',
}
_SHORT = {
    'f4': 'increased friction',
    'f7': 'medium evaporation',
    'f9': 'housing tightness',
    'f12': 'E/P transducer fault',
    'f13': 'position sensor fault',
    'f16': 'supply pressure drop',
    'f17': 'pressure change',
    'f18': 'opened bypass valve',
    'f2': 'sedimentation',
    'f3': 'erosion',
    'f15': 'position feedback fault',
}
_NEGATIVE = {'f12', 'f14', 'f19'}  # the direction of the standard scenarios


def draw_step_response() -> 'Figure':
    """
    Draw a step to closed and back on both models.

    :return: the figure.
    """
    from matplotlib import pyplot

    scenario = Scenario('step', 60, cv=Steps((0, 20), (1.0, 0.0)))
    figure, (above, middle, below) = pyplot.subplots(
        3,
        1,
        figsize=(7.2, 5.2),
        sharex=True,
        layout='constrained',
        gridspec_kw={'height_ratios': (3, 2, 2)},
    )
    for model, colour, style in (('dablib', FAULTY, '-'), ('lugre', LUGRE, (0, (5, 3)))):
        run = simulate(scenario, rate=100, model=model)
        name = {'dablib': 'DABLib', 'lugre': 'LuGre'}[model]
        above.plot(run.t, run.x1, color=colour, ls=style, label=f"position X', {name}")
        middle.plot(run.t, run.ps / 1e3, color=colour, ls=style)
        below.plot(run.t, run.flow, color=colour, ls=style)
    above.plot(run.t, run.cv, color=SET_POINT, lw=1, ls=':', label='control value CV')
    above.annotate(
        'dead time 2.9 s',
        (2.9, 0.03),
        (4.5, 0.2),
        color=FAULTY,
        arrowprops={'arrowstyle': '->', 'color': FAULTY},
    )
    above.annotate(
        'venting is slower\nthan filling',
        (37, 0.5),
        (42, 0.62),
        color=FAULTY,
        arrowprops={'arrowstyle': '->', 'color': FAULTY},
    )
    above.legend(loc='center right', frameon=False, bbox_to_anchor=(1, 0.35))
    above.set_ylabel('0 open, 1 closed')
    middle.set_ylabel('chamber [kPa]')
    below.set_ylabel('flow [kg/s]')
    below.set_xlabel('t [s]')
    above.set_title('Step of the control value', loc='left', weight='bold')
    return figure


def _panel(axes: 'Axes', fault: str, nominal: Run) -> None:
    strength = -0.75 if fault in _NEGATIVE else 0.75
    scenario = replace(load_scenario('nominal'), faults=(Fault(fault, strength, start=900.0),))
    run = simulate(scenario, rate=10, duration=1000.0)
    shown = slice(8800, None)
    t = run.t[shown] - 900
    if fault == 'f14':
        axes.plot(t, nominal.ps[shown] / 400e3, color=NOMINAL)
        axes.plot(t, run.ps[shown] / 400e3, color=CHAMBER)
    else:
        for name, span, colour in (('flow', 40 / 3.6, FLOW), ('x1', 1.0, FAULTY)):
            axes.plot(t, nominal[name][shown] / span, color=NOMINAL)
            axes.plot(t, run[name][shown] / span, color=colour)
    axes.axvline(0, color=SET_POINT, lw=0.7, ls=':')
    name = _SHORT.get(fault, CATALOGUE[fault].name)
    axes.set_title(f'{fault}  {name}', loc='left', fontsize=8)
    axes.set_ylim(-0.03, 1.03)


def draw_fault_effects() -> 'Figure':
    """
    Draw what each fault does to position and flow under the benchmark's inputs.

    :return: the figure.
    """
    from matplotlib import pyplot
    from matplotlib.lines import Line2D

    nominal = simulate('nominal', rate=10, duration=1000.0)
    figure, grid = pyplot.subplots(
        4, 5, figsize=(11, 6.6), sharex=True, sharey=True, layout='constrained'
    )
    panels = list(grid.flat)
    for axes, fault in zip(panels, CATALOGUE, strict=False):
        _panel(axes, fault, nominal)
    key = panels[-1]
    key.axis('off')
    lines = [
        ("position X'", FAULTY),
        ("flow F'", FLOW),
        ('chamber pressure (f14)', CHAMBER),
        ('without the fault', NOMINAL),
    ]
    key.legend(
        [Line2D([], [], color=colour) for _, colour in lines],
        [text for text, _ in lines],
        loc='center',
        frameon=False,
    )
    for axes in grid[-1][:-1]:
        axes.set_xlabel('s after the fault')
    figure.suptitle(
        'Each fault at strength 0.75 (f12, f14, f19: -0.75), shares of the range',
        x=0.01,
        ha='left',
        weight='bold',
        fontsize=10,
    )
    return figure


def _save(figure: 'Figure', path: Path) -> None:
    """Save with few colours: a third of the size."""
    from PIL import Image

    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=100)
    Image.open(buffer).convert('RGB').quantize(64, dither=Image.Dither.NONE).save(
        path, optimize=True
    )


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command `figures`.

    :param args: arguments, those of the process where absent.
    :return: exit code.
    """
    p = argparse.ArgumentParser(
        prog='figures',
        description=__doc__,
        epilog='example: ros2 run damadics_plant figures --out doc',
    )
    p.add_argument('--out', type=Path, default=Path(), metavar='FOLDER')
    out = p.parse_args(args).out
    try:
        import matplotlib
    except ImportError:
        print('figures: matplotlib is missing; pip install matplotlib', file=sys.stderr)
        return 1
    matplotlib.use('Agg')
    with matplotlib.rc_context(_STYLE):
        try:
            out.mkdir(parents=True, exist_ok=True)
            _save(draw_step_response(), out / 'step_response.png')
            _save(draw_fault_effects(), out / 'fault_effects.png')
        except OSError as error:
            print(f'figures: {error}', file=sys.stderr)
            return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
