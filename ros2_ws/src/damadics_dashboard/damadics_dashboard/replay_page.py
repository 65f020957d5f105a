# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page for recordings: drop a bag, see what the detector makes of it."""

import json
import tempfile
from html import escape
from pathlib import Path
from typing import Any

from damadics_fd.bag.errors import BagError
from nicegui import run, ui

from damadics_dashboard import markup
from damadics_dashboard.frame import card, frame
from damadics_dashboard.playback import MODES, Playback, play
from damadics_dashboard.plots import Plot, signature_plot, time_plot
from damadics_dashboard.valve import age, moment
from damadics_dashboard.watcher import Watcher

LARGEST = 2 << 30  # B
HINT = 'Drop an MCAP bag here, or choose one: the same estimator and detector, the same flags.'


def replay_page(watcher: Watcher) -> None:
    """
    Draw the page.

    :param watcher: the ROS side.
    """
    with frame('Replay', '/replay', watcher):
        with ui.element('div').classes('row w-full'):
            ui.html('<h1>Replay a recording</h1>', sanitize=False)
            ui.element('span').classes('spacer')
            mode = (
                ui.toggle(list(MODES), value=MODES[0])
                .props('no-caps dense unelevated padding="4px 12px" aria-label="mode"')
                .classes('seg')
            )
        results = ui.element('div').classes('stack w-full')

        async def take(event: Any) -> None:
            upload.disable()
            results.clear()
            with results:
                ui.html('<div class="card" role="status">Replaying …</div>', sanitize=False)
            name = Path(event.file.name).name or 'recording.mcap'
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder, name)
                await event.file.save(path)
                try:
                    shown: list[Playback] | str = await run.io_bound(play, path, mode.value)
                except (BagError, OSError, ValueError, RuntimeError) as problem:
                    shown = str(problem).replace(folder, '').lstrip('/')
            results.clear()
            with results:
                if isinstance(shown, str):
                    ui.html(
                        f'<div class="card" role="alert"><h2>{escape(name)} cannot be replayed'
                        f'</h2><p class="sub">{escape(shown)}</p></div>',
                        sanitize=False,
                    )
                else:
                    for playback in shown:
                        _show(playback, mode.value)
            upload.reset()
            upload.enable()

        with ui.element('div').classes('drop w-full') as box:
            upload = ui.upload(
                on_upload=take,
                auto_upload=True,
                max_file_size=LARGEST,
                label=HINT,
                on_rejected=lambda: ui.notify(
                    'this file is too large for the page: ros2 run damadics_fd replay FILE',
                    type='negative',
                ),
            ).props('accept=".mcap,.csv,.txt" flat aria-label="recording to replay"')
        box.move(target_index=1)


def _show(done: Playback, mode: str) -> None:
    """Draw the verdict and the plots of one recording."""
    alarms = done.alarms
    worst = max((e.level for e in done.events if alarms), default=0)
    kind = markup.NE107.get(worst, ('', ''))[0] or 'ok'
    verdict = (
        f'{len(alarms)} alarm{"s" if len(alarms) > 1 else ""}, the first at '
        f'{moment(alarms[0].stamp)}'
        if alarms
        else 'No alarm'
    )
    cause = next(
        (e.cause for e in reversed(done.events) if e.cause not in ('', 'undetermined')), ''
    )
    detail = ' · '.join(
        filter(
            None,
            (
                done.name,
                f'mode {mode}',
                f'{done.samples} samples',
                age(done.duration),
                done.truth,
                f'suspected: {cause}' if cause else '',
            ),
        )
    )
    lost = ''.join(f'<div class="sub">left out: {escape(p)}</div>' for p in done.problems[:5])
    ui.html(
        f'<div class="banner {kind}" data-kind="{kind}" role="status">'
        f'{markup.symbol(kind, "big")}<span class="words"><span class="title">'
        f'{escape(verdict)}</span><br><span class="sub">{escape(detail)}</span>{lost}</span>'
        '</div>',
        sanitize=False,
    ).classes('w-full')
    with ui.element('div').classes('grid'):
        with ui.element('div').classes('stack'):
            plots = [
                _plot(
                    'Control value and position',
                    ['CV', 'X1'],
                    ['cv', 'x1'],
                    ['--cv', '--x1'],
                    done,
                    '[1]',
                    low=0.0,
                    high=1.0,
                    dashed=('CV',),
                ),
                _plot(
                    'Residual against threshold',
                    ['residual', 'threshold'],
                    ['residual', 'threshold'],
                    ['--residual', '--rho'],
                    done,
                    '[1/s]',
                    log=True,
                    dashed=('threshold',),
                ),
                _plot('Stem velocity', ['X2'], ['x2'], ['--velocity'], done, '[1/s]'),
            ]
        with ui.element('div').classes('stack'), card('Valve signature', 'input over position'):
            names = ('before the alarm', 'since the alarm') if alarms else ('whole recording',)
            cloud = Plot(
                signature_plot(names),
                ['--before', '--now'][-len(names) :],
                'valve signature: force over position',
                'plot tall',
            )
    with ui.element('section').classes('card w-full'):
        ui.html('<div class="head"><h2>Transitions</h2></div>', sanitize=False)
        ui.html(markup.history_table(done.rows()[:500], name=False), sanitize=False).classes(
            'w-full'
        )
    message: dict[int, Any] = {}
    for plot, series in plots:
        message[plot.id] = {'all': True, 'series': series, 'from': [], 'range': done.range}
    message[plots[1][0].id]['areas'] = done.areas()
    message[cloud.id] = {'all': True, 'series': done.signature, 'from': []}
    ui.run_javascript(f'damadics.push({json.dumps(message, separators=(",", ":"))})')


def _plot(
    title: str,
    names: list[str],
    curves: list[str],
    colors: list[str],
    done: Playback,
    unit: str,
    **options: Any,
) -> tuple[Plot, list[Any]]:
    with card(title):
        plot = Plot(
            time_plot(names, unit, zoom=True, **options), colors, f'{title} over time', 'plot zoom'
        )
    return plot, [done.curves[name] for name in curves]
