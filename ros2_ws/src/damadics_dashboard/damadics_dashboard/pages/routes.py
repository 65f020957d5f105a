# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The addresses of the page."""

import time
from urllib.parse import quote

from fastapi import Request, Response
from fastapi.concurrency import run_in_threadpool
from nicegui import app, ui

from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.fleet_page import fleet_page
from damadics_dashboard.pages.history_page import history_page
from damadics_dashboard.pages.replay_page import replay_page
from damadics_dashboard.pages.valve.valve_page import valve_page
from damadics_dashboard.report import content, forms
from damadics_dashboard.words.texts import Texts, preferred, texts

DAY = 86400.0
LONGEST = 3660  # days
FLEET = 'FLEET'
KINDS = {
    'html': 'text/html',
    'pdf': 'application/pdf',
    'csv': 'text/csv',
    'trends': 'text/csv',
}


def add_routes(watcher: Watcher) -> None:
    """
    Serve the pages and the reports.

    :param watcher: the ROS side.
    """

    @ui.page('/')
    def fleet() -> None:
        fleet_page(watcher)

    @ui.page('/history')
    def history(text: str = '', valve: str = '') -> None:
        history_page(watcher, text, valve)

    @ui.page('/replay')
    def replay() -> None:
        replay_page(watcher)

    @ui.page('/valve/{name:path}')
    def valve(name: str, window: float = 60.0, days: str = '') -> None:
        valve_page(watcher, name, window, days)

    @app.get('/state')
    def state() -> dict[str, str]:
        now, clock = time.monotonic(), watcher.clock
        valves = tuple(watcher.valves.values())
        return {valve.name: valve.condition(now, clock).kind for valve in valves}

    sources = content.Sources(watcher.history, watcher.trends.intervals)

    @app.get('/report')
    async def report(request: Request, of: str = FLEET, days: int = 30) -> Response:
        kind = request.query_params.get('as', 'html')
        name = '' if of == '~root' else of
        known = name == FLEET or name in watcher.valves or name in sources.valves()
        if kind not in KINDS or not known or not 0 < days <= LONGEST:
            return Response('there is no such report\n', 404, media_type='text/plain')
        return await run_in_threadpool(_report, sources, name, days, kind, _words(request))


def _words(request: Request) -> Texts:
    chosen = request.cookies.get('language', '')
    return texts(chosen or preferred(request.headers.get('accept-language', '')))


def _report(sources: content.Sources, name: str, days: int, kind: str, t: Texts) -> Response:
    until = time.time()
    since = until - DAY * days
    if name == FLEET:
        report = content.fleet_report(sources, since, until, t)
    else:
        report = content.valve_report(sources, name, since, until, t)
    body: str | bytes
    if kind == 'pdf':
        from damadics_dashboard.report.paper import pdf  # an extra, and slow to load

        body = pdf(report, t)
    elif kind == 'html':
        body = forms.html(report, t)
    else:
        body = forms.trends_csv(report) if kind == 'trends' else forms.text_csv(report)
    end = '_trends.csv' if kind == 'trends' else f'.{kind}'
    file = f"inline; filename*=UTF-8''report_{quote(name or 'valve', safe='')}{end}"
    return Response(body, media_type=KINDS[kind], headers={'content-disposition': file})
