# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page for recordings: drop one, see what the detector makes of it."""

import logging
import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from damadics_fd.core.settings import SettingsError
from damadics_fd.core.text import COMMENT, NAME, SENTENCE, plain
from damadics_fd.web.limits import LARGEST_UPLOAD
from nicegui import events, run, ui

from damadics_dashboard.live.judged import NE107
from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.charts import Options, signature_plot, time_plot
from damadics_dashboard.pages.elements import box, markup, tell, with_values
from damadics_dashboard.pages.frame import card, frame
from damadics_dashboard.pages.plots import News, Plot
from damadics_dashboard.words.answers import answer_words
from damadics_dashboard.words.findings import cause_of, faults_of
from damadics_dashboard.words.texts import Texts
from damadics_dashboard.words.valve_words import history_rows

if TYPE_CHECKING:
    from damadics_dashboard.pages.playback import Given, Playback, Truth

MODES = ('monitor', 'paper', 'scada')
MOST_SHOWN = 20  # recordings of one file
MOST_ROWS = 500
LARGEST_SETTINGS = 100_000  # bytes
KINDS = '.mcap,.csv,.txt,.parquet'


def replay_page(watcher: Watcher) -> None:
    """
    Draw the page.

    :param watcher: the ROS side.
    """
    with frame('replay', '/replay', watcher) as t:
        with box('div', 'row w-full'):
            markup('title.html', text=t('replay_title'))
            box('span', 'spacer')
            mode = ui.toggle(list(MODES), value=MODES[0]).classes('seg')
            mode.props('no-caps dense unelevated padding="4px 12px"')
            with_values(mode, role='group', aria_label=t('mode'))
        explained = ui.label(t(f'mode_{MODES[0]}')).classes('sub')
        mode.on_value_change(lambda: explained.set_text(t(f'mode_{mode.value}')))
        drop = box('div', 'drop w-full')
        chosen = _SettingsOfValve(mode, t)
        results = box('div', 'stack w-full')

        async def take(event: events.UploadEventArguments) -> None:
            name = plain(Path(event.file.name).name, NAME) or 'recording.mcap'
            upload.disable()
            results.clear()
            with results:
                markup('message.html', role='status', title=t('replaying', name=name))
            try:
                shown = await _replayed(event, str(mode.value), chosen.given, t)
            finally:
                upload.reset()
                upload.enable()
            results.clear()
            with results:
                if isinstance(shown, str):
                    title = t('cannot_replay', name=name)
                    markup('message.html', role='alert', title=title, lines=[shown])
                    return
                for playback in shown[:MOST_SHOWN]:
                    _show(playback, str(mode.value), t)
                if len(shown) > MOST_SHOWN:
                    ui.label(t('more_recordings', number=len(shown) - MOST_SHOWN))

        with drop:
            upload = ui.upload(
                on_upload=take,
                auto_upload=True,
                max_file_size=LARGEST_UPLOAD,
                label=t('replay_hint'),
                on_rejected=lambda: ui.notify(t('not_taken'), type='negative'),
            ).props('flat')
            with_values(upload, accept=KINDS, aria_label=t('recording_to_replay'))


class _SettingsOfValve:
    """
    A field for the file that `commission` wrote: recordings are replayed with what it says.

    :param mode: the choice of the mode; the file's is taken.
    :param t: the words.
    """

    def __init__(self, mode: ui.toggle, t: Texts) -> None:
        self.given: Given = {}
        self._mode = mode
        self._t = t
        with box('div', 'row w-full settings-file'):
            upload = ui.upload(
                on_upload=self._take,
                auto_upload=True,
                max_file_size=LARGEST_SETTINGS,
                label=t('settings_hint'),
                on_rejected=lambda: ui.notify(t('settings_not_taken'), type='negative'),
            ).props('flat')
            with_values(upload, accept='.yaml,.yml', aria_label=t('settings_file'))
            self._upload = upload
            self._said = ui.label(t('settings_none')).classes('sub')
            with_values(self._said, role='status')

    async def _take(self, event: events.UploadEventArguments) -> None:
        from damadics_dashboard.pages.playback import settings_in_file  # slow to load

        t, name = self._t, plain(event.file.name, NAME)
        try:
            self.given = settings_in_file((await event.file.read()).decode('utf-8'))
            said = t('settings_taken', name=name, number=len(self.given))
        except (SettingsError, UnicodeDecodeError) as problem:
            self.given = {}
            said = t('settings_refused', name=name, why=plain(str(problem), COMMENT))
        if self.given.get('mode') in MODES:
            self._mode.set_value(self.given['mode'])
        self._said.set_text(said)
        self._upload.reset()


async def _replayed(
    event: events.UploadEventArguments, mode: str, settings: 'Given', t: Texts
) -> 'list[Playback] | str':
    """Replay what was dropped; return why not as a sentence."""
    # what judges recordings takes seconds to load, which the page does not wait for
    from damadics_dashboard.pages.playback import play

    suffix = ''.join(c for c in Path(event.file.name).suffix if c.isalnum() or c == '.')[:10]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f'recording{suffix or ".mcap"}')
        try:
            await event.file.save(path)
            done = await run.io_bound(play, path, mode, plain(event.file.name, NAME), settings)
            return done or []  # none where the page is closing
        except Exception as problem:  # a recording of somebody else must not hold up the page
            logging.getLogger(__name__).warning('replay failed: %r', problem)
            said = plain(str(problem).replace(folder, '').lstrip('/'), COMMENT)
            return said or t('damaged_recording')


def truth_words(truth: 'Truth | None', t: Texts) -> str:
    """
    Say which fault was simulated, and when it was flagged.

    :param truth: of a recording; None where it does not tell.
    :param t: the words.
    :return: text.
    """
    if truth is None:
        return ''
    if not truth.fault:
        return t('truth_none')
    told = t('truth_fault', fault=truth.fault, start=t.local(f'{truth.start:.2f}'))
    if math.isnan(truth.delay):
        return f'{told}, {t("truth_missed")}'
    return f'{told}, {t("truth_flagged", delay=t.local(f"{truth.delay:.2f}"))}'


def _show(done: 'Playback', mode: str, t: Texts) -> None:
    """Draw the verdict and the plots of one recording."""
    alarms = done.alarms
    worst = max((e.level for e in done.events if alarms), default=0)
    kind = NE107.get(worst, '') or 'ok'
    verdict = t('no_alarm_found') if done.monitored else t('never_monitored')
    if alarms:
        verdict = t('alarms_found', number=len(alarms), time=t.moment(alarms[0].stamp))
    elif not done.monitored:
        kind = 'off'
    names = (e.cause for e in reversed(done.events) if e.cause not in ('', 'undetermined'))
    name = next(names, '')
    cause = cause_of(name, t)
    suspect = faults_of(name, t) if cause is None else cause.words()[0]
    facts = (
        done.name,
        f'{t("mode")} {mode}',
        t('sample_count', number=done.samples),
        t.duration(done.duration),
        truth_words(done.truth, t),
        t('suspected', cause=suspect) if suspect and alarms else '',
        '' if done.monitored else answer_words(done.status, t.language),
    )
    left_out = [t('left_out', what=plain(p, COMMENT)) for p in done.problems[:5]]
    detail = ' · '.join(plain(fact, SENTENCE) for fact in (*facts, *left_out) if fact)
    markup('banner.html', kind=kind, title=verdict, detail=detail, figures=[]).classes('w-full')
    message: dict[int, News] = {}

    def plot(title: str, curves: dict[str, tuple[str, str]], options: Options) -> int:
        with card(t(title)):
            drawn = Plot(
                options,
                [color for _, color in curves.values()],
                t(title),
                group=f'replay{id(done)}',
            )
        series = [done.curves[name] for name, _ in curves.values()]
        message[drawn.id] = {'all': True, 'series': series, 'from': [], 'range': done.range}
        return drawn.id

    cv, x1 = t('signal_cv'), t('signal_x1')
    residual, limit = t('residual'), t('limit')
    with box('div', 'grid'):
        with box('div', 'stack'):
            plot(
                'position_title',
                {cv: ('cv', '--cv'), x1: ('x1', '--x1')},
                time_plot([cv, x1], '%', low=0.0, high=100.0, dashed=(cv,)),
            )
            judged = plot(
                'residual_title',
                {residual: ('residual', '--residual'), limit: ('threshold', '--rho')},
                time_plot([residual, limit], '1/s', log=True, dashed=(limit,)),
            )
            velocity = t('velocity')
            plot('velocity_title', {velocity: ('x2', '--velocity')}, time_plot([velocity], '1/s'))
        with box('div', 'stack'), card(t('signature_title'), t('signature_remark')):
            clouds = (t('before_alarm'), t('since_alarm')) if alarms else (t('whole_recording'),)
            cloud = Plot(
                signature_plot(clouds, t('signature_x'), t('signature_y')),
                ['--before', '--now'][-len(clouds) :],
                t('signature_label'),
                'plot tall',
            )
    message[judged]['areas'] = done.areas()
    message[cloud.id] = {'all': True, 'series': done.signature, 'from': []}
    with card(t('history'), classes='w-full'):
        markup(
            'history.html',
            rows=history_rows(done.rows()[:MOST_ROWS], t),
            empty=t('nothing_happened'),
            caption=t('alarm_history'),
            heads=[t(k) for k in ('time', 'class', 'what', 'alarm', 'peak', 'text')],
            named=False,
        ).classes('w-full')
    tell('push', message)
