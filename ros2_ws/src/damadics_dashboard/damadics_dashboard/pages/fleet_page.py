# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The overview: one tile per valve, by area, found by search and class; and every alarm."""

import time
from typing import Literal, TypedDict

from damadics_fd.core.text import COMMENT, plain
from nicegui import ui

from damadics_dashboard.live.valve import Valve
from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.alarms import AlarmList
from damadics_dashboard.pages.elements import markup, tell
from damadics_dashboard.pages.frame import card, frame
from damadics_dashboard.words.texts import Texts
from damadics_dashboard.words.valve_words import address, area_of, headline, of_limit, reason_of

PERIOD = 0.2  # s
LARGE = 100  # valves from which on the page is drawn twice a second
TURNS = 10  # of drawing in which the residuals of a large fleet are told once, for they never rest
RESTLESS: tuple[Literal['ratio', 'share'], ...] = ('ratio', 'share')
KINDS = ('F', 'S', 'M', 'C', 'off', 'learn', 'ok')
START = 'ros2 run damadics_bringup run --simulate'


class Tile(TypedDict):
    """What the page's script draws of a valve."""

    kind: str
    title: str
    tag: str
    state: str
    badge: str
    hot: bool
    why: str
    ratio: str
    share: float
    progress: float
    fresh: str
    never: str
    area: str
    address: str
    label: str


class Changes(TypedDict, total=False):
    """What has changed on the page since it was told last."""

    tiles: dict[str, Tile]
    ages: list[float | None]  # s, of all valves
    order: list[str]


def fleet_page(watcher: Watcher) -> None:
    """
    Draw the page.

    :param watcher: the ROS side.
    """
    with frame('fleet', '/', watcher) as t:
        classes = [(kind, t(f'count_{kind}')) for kind in KINDS]
        markup('fleet.html', t=t, classes=classes).classes('w-full')
        trouble = ui.label('').classes('note')
        markup('tiles.html', t=t, start=START).classes('w-full')
        with card(t('alarms'), classes='w-full') as head:
            with head:
                number = ui.label('').classes('sub')
            alarms = AlarmList(watcher, lambda: tuple(watcher.valves.values()), t, name=True)
        tell('filters')
        shown = Tiles(watcher, t)

        def update() -> None:
            message = shown.news()
            if message is not None:
                tell('fleet', message)
            present = alarms.update()
            number.set_text(t('number_present', number=present) if present else '')
            problem = watcher.history.problem or watcher.trends.problem
            trouble.set_text(plain(problem, COMMENT))
            trouble.set_visibility(bool(problem))

        update()
        ui.timer(0.5 if len(watcher.valves) > LARGE else PERIOD, update)


class Tiles:
    """
    What the browser knows of the tiles, so that only what has changed is sent.

    :param watcher: the ROS side.
    :param t: the words.
    """

    def __init__(self, watcher: Watcher, t: Texts) -> None:
        self._watcher = watcher
        self._t = t
        self._told: dict[str, Tile] = {}
        self._order: list[str] | None = None
        self._turn = 0

    def news(self) -> Changes | None:
        """
        Return what has changed.

        :return: the message for `damadics.fleet`; ages are those of all valves.
        """
        now, clock = time.monotonic(), self._watcher.clock
        valves = sorted(self._watcher.valves.values(), key=lambda v: (v.area, v.title))
        changed: dict[str, Tile] = {}
        self._turn += 1
        for number, valve in enumerate(valves, self._turn):
            told = tile(valve, self._t, now, clock)
            before = self._told.get(valve.name)
            if len(valves) > LARGE and number % TURNS and before and before['kind'] == 'ok':
                for name in RESTLESS if told['kind'] == 'ok' else ():
                    told[name] = before[name]
            if before != told:
                self._told[valve.name] = changed[valve.name] = told
        ages = [valve.age(now, clock) for valve in valves]
        message: Changes = {
            'tiles': changed,
            'ages': [None if age is None else round(age, 1) for age in ages],
        }
        order = [valve.name for valve in valves]
        if order != self._order:
            self._order = message['order'] = order
        return message


def tile(valve: Valve, t: Texts, now: float, clock: int) -> Tile:
    """
    Say what the tile of a valve shows.

    :param valve: the valve.
    :param t: the words.
    :param now: monotonic time [s].
    :param clock: ROS time [ns].
    :return: texts and numbers by the names that the page's script knows.
    """
    condition = valve.condition(now, clock)
    alarm = valve.alarm()
    why = '' if condition.kind == 'off' and condition.value == condition.value else None
    why = reason_of(valve, condition, t, now) if why is None else t(f'{condition.detail}_short')
    badge, hot = '', False
    if alarm is not None:
        what, _, _ = headline(alarm.evidence, t)
        hot = not alarm.acknowledged
        if condition.kind == 'off':
            badge, why = t('alarm_open'), f'{why} · {what}'
        else:
            badge = t('acknowledged' if alarm.acknowledged else 'unacknowledged')
            why = t('state_lost') if alarm.state == 'unknown' else what
    ratio = valve.ratio
    if valve.flag is not None and valve.flag.threshold > 0.0:
        ratio = max(ratio, valve.flag.residual / valve.flag.threshold)
    learning, monitored = condition.kind == 'learn', condition.kind != 'off'
    ratio = ratio if monitored else 0.0  # of a time that is over
    state = t(condition.title)
    return {
        'kind': condition.kind,
        'title': valve.title.removeprefix(f'{area_of(valve.name)}/'),
        'tag': valve.tag if valve.tag != valve.title else '',
        'state': state,
        'badge': badge,
        'hot': hot,
        'why': why,
        'ratio': t.percent(valve.progress)
        if learning
        else of_limit(ratio, t)
        if monitored
        else '',
        'share': round(min(ratio, 2.0), 2),
        'progress': round(valve.progress, 3) if learning else -1,
        'fresh': t('last_sample'),
        'never': t('never'),
        'area': valve.area or area_of(valve.name),
        'address': address(valve.name),
        'label': f'{valve.title}: {state}, {why}',
    }
