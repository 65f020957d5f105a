# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The overview: one tile per valve, by area, found by search and class; and every alarm."""

import json
import math
from typing import TypedDict

from damadics_fd.core.text import COMMENT, plain
from nicegui import ui

from damadics_dashboard.live.overview import Overview, Place, ratio_of
from damadics_dashboard.live.valve import Condition, Valve
from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.alarms import AlarmList
from damadics_dashboard.pages.elements import markup, tell
from damadics_dashboard.pages.frame import card, frame
from damadics_dashboard.words.findings import headline, of_limit
from damadics_dashboard.words.texts import Texts
from damadics_dashboard.words.valve_words import address, area_of, reason_of

PERIOD = 0.2  # s
ABOVE = 30  # valves from which on alarms stand above the tiles: nobody scrolls past so many
LARGE = 100  # valves from which on the page is drawn twice a second
STEPS = 20  # in which the learning of the valves of a large fleet is told
EVERY = 0.9  # s at least between two times that ages and residuals of a large fleet are told
KINDS = ('F', 'S', 'M', 'C', 'off', 'learn', 'ok')
START = 'ros2 run damadics_bringup run --simulate'
Brief = tuple[str, str, str, int, str, Place]


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
        overview = watcher.overview
        many = len(watcher.valves) > ABOVE
        tiles = markup('tiles.html', t=t, start=START).classes('w-full')

        def alarmed() -> list[Valve]:
            return [valve for valve in overview.valves if valve.name in overview.alarms]

        with card(t('alarms'), classes='w-full above' if many else 'w-full') as head:
            with head:
                number = ui.label('').classes('sub')
            alarms = AlarmList(watcher, alarmed, t, name=True)
        if many:
            tiles.move(target_index=-1)
        tell('filters')
        shown = Tiles(overview, t)

        def update() -> None:
            overview.look()
            ui.run_javascript(f'damadics.fleet({shown.message()})')
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

    :param overview: the valves, as they were looked at last.
    :param t: the words.
    """

    def __init__(self, overview: Overview, t: Texts) -> None:
        self._overview = overview
        self._t = t
        self._told: dict[str, Tile] = {}
        self._brief: dict[str, Brief] = {}
        self._places: list[Place] = []
        self._columns = -math.inf  # when ages and residuals were told last [s]

    def message(self) -> str:
        """
        Return what the page's script is to be told.

        :return: arguments of `damadics.fleet` as JSON: what has changed, and, not each time for a
            large fleet, ages and residuals of all valves.
        """
        news = self.news()
        words = json.dumps(news, separators=(',', ':'), allow_nan=False)
        looked = self._overview.looked
        if 'order' not in news and looked - self._columns < EVERY * (len(self._told) > LARGE):
            return words
        self._columns = looked
        return f'{words},{self._overview.columns}'

    def news(self) -> Changes:
        """
        Return what has changed.

        :return: tiles by the name of their valves, and the order where that is another one.
        """
        overview, now, clock = self._overview, self._overview.looked, self._overview.clock
        changed: dict[str, Tile] = {}
        places, steps = overview.places, STEPS * (len(overview.valves) > LARGE)
        for valve, condition, place in zip(
            overview.valves, overview.conditions, places, strict=True
        ):
            name = valve.name
            brief = None
            if name not in overview.alarms:
                brief = brief_of(valve, condition, place, steps if valve.fleet else 0)
            if brief is not None:  # as nearly all of a large fleet
                if self._brief.get(name) == brief:
                    continue
                self._brief[name] = brief
            else:
                self._brief.pop(name, None)
            told = tile(valve, self._t, now, clock)
            if self._told.get(name) != told:
                self._told[name] = changed[name] = told
        news: Changes = {'tiles': changed}
        if places != self._places:
            self._places = places
            news['order'] = [valve.name for valve in overview.valves]
        return news


def brief_of(valve: Valve, condition: Condition, place: Place, steps: int) -> Brief | None:
    """
    Return what the words on a tile without an alarm depend on.

    :param valve: the valve.
    :param condition: of it.
    :param place: area and title.
    :param steps: in which learning is told; 0: as it goes on.
    :return: it; None where they depend on more.
    """
    learned = 0
    if condition.kind == 'learn' and steps:
        learned = int(steps * condition.value)
    elif condition.kind != 'ok' and (condition.kind != 'off' or math.isnan(condition.value)):
        return None
    return condition.kind, condition.title, condition.detail, learned, valve.tag, place


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
    ratio = ratio_of(valve)
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
