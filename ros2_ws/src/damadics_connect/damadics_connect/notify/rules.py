# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who is told what and when: rules by class, valve, area and time of day; debounce and digest."""

from collections.abc import Callable, Iterable
from datetime import datetime, time
from fnmatch import fnmatchcase
from typing import NamedTuple

from damadics_connect.judgement import CLASSES, TRANSITIONS, Judgement, Transition
from damadics_connect.settings import Section

DAYS = ('mon', 'tue', 'wed', 'thu', 'fri', 'sat', 'sun')
SILENT = 'not_monitored'  # told like a transition: silence is not health
USUAL = ('raised', 'changed', 'cleared', SILENT)
ENDINGS = ('cleared', 'reset')
TITLES = {'raised': 'alarm', 'changed': 'alarm changed', 'cleared': 'alarm over'} | {
    SILENT: 'not monitored'
}
MOST_LINES = 200  # of one message


class News(NamedTuple):
    """What is worth a message."""

    valve: str
    actuator: str
    area: str
    what: str  # a transition or SILENT
    ne107: str
    text: str
    when: str


class Rule(NamedTuple):
    """Whom a kind of news goes to."""

    targets: tuple[str, ...]
    classes: tuple[str, ...]
    what: tuple[str, ...]
    valves: tuple[str, ...]
    areas: tuple[str, ...]
    begin: time
    end: time
    days: tuple[str, ...]
    debounce: float  # s
    digest: float  # s

    def fits(self, news: News, now: datetime) -> bool:
        """
        Tell whether a rule is for some news.

        :param news: what has happened.
        :param now: local time.
        :return: True where its targets are to be told.
        """
        clock = now.time()
        if self.begin <= self.end:
            in_time = self.begin <= clock <= self.end
        else:  # over midnight
            in_time = clock >= self.begin or clock <= self.end
        names = (news.valve, news.actuator)
        return (
            news.what in self.what
            and (news.ne107 in self.classes or news.what in (*ENDINGS, SILENT))
            and any(fnmatchcase(name, pattern) for pattern in self.valves for name in names)
            and (not self.areas or any(fnmatchcase(news.area, p) for p in self.areas))
            and in_time
            and DAYS[now.weekday()] in self.days
        )


class Message(NamedTuple):
    """A message to one target."""

    target: str
    title: str
    body: str


class Desk:
    """
    Turns news into messages: waits whether an alarm lasts, gathers what comes together.

    :param rules: in the order of the configuration.
    :param send: takes messages.
    """

    def __init__(self, rules: Iterable[Rule], send: Callable[[Message], None]) -> None:
        self._rules = tuple(rules)
        self._send = send
        self._waiting: dict[tuple[int, str], tuple[float, News]] = {}
        self._told: set[tuple[int, str]] = set()  # whose alarm was told, so that its end is too
        self._gathered: dict[int, tuple[float, list[News]]] = {}

    def take(self, news: News, now: float, clock: datetime) -> None:
        """
        Take news.

        :param news: what has happened.
        :param now: monotonic time [s].
        :param clock: local time.
        """
        for number, rule in enumerate(self._rules):
            key = number, news.valve
            if news.what in ENDINGS:
                if self._waiting.pop(key, None) is not None:
                    continue  # it has not lasted: nobody is told of either
                if key not in self._told:
                    continue
                self._told.discard(key)
                if news.what in rule.what:
                    self._gather(number, news, now)
            elif rule.fits(news, clock):
                if rule.debounce and news.what == 'raised':
                    self._waiting[key] = now + rule.debounce, news
                elif key in self._waiting and news.what == 'changed':
                    self._waiting[key] = self._waiting[key][0], news._replace(what='raised')
                else:
                    self._told.add(key)
                    self._gather(number, news, now)
        self.look(now)

    def look(self, now: float) -> None:
        """
        Send what is due.

        :param now: monotonic time [s].
        """
        for key, (due, news) in list(self._waiting.items()):
            if now >= due:
                del self._waiting[key]
                self._told.add(key)
                self._gather(key[0], news, now)
        for number, (due, gathered) in list(self._gathered.items()):
            if now >= due:
                del self._gathered[number]
                self._write(self._rules[number], gathered)

    def finish(self) -> None:
        """Send what is still gathered, before the end."""
        for number, (_, gathered) in self._gathered.items():
            self._write(self._rules[number], gathered)
        self._gathered.clear()

    def _gather(self, number: int, news: News, now: float) -> None:
        rule = self._rules[number]
        if not rule.digest:
            self._write(rule, [news])
            return
        self._gathered.setdefault(number, (now + rule.digest, []))[1].append(news)

    def _write(self, rule: Rule, gathered: list[News]) -> None:
        first = gathered[0]
        title = f'{first.actuator or first.valve}: {TITLES.get(first.what, first.what)}'
        if len(gathered) > 1:
            valves = len({news.valve for news in gathered})
            title = f'{len(gathered)} messages of {valves} valve(s)'
        lines = [line_of(news) for news in gathered[:MOST_LINES]]
        if len(gathered) > MOST_LINES:
            lines.append(f'... and {len(gathered) - MOST_LINES} more')
        for target in rule.targets:
            self._send(Message(target, f'[DAMADICS FD] {title}', '\n'.join(lines)))


def line_of(news: News) -> str:
    """
    Word some news.

    :param news: what has happened.
    :return: one line.
    """
    level = news.ne107.replace('_', ' ')
    kind = TITLES.get(news.what, news.what.replace('_', ' '))
    return f'{news.when} {news.actuator or news.valve} {kind} ({level}): {news.text or "-"}'


def news_of_event(event: Transition, known: Judgement, when: str) -> News:
    """Return a transition as news; `known` has the area."""
    return News(
        event.valve, event.actuator, known.area, event.transition, event.ne107, event.text, when
    )


def news_of_silence(judgement: Judgement, when: str) -> News:
    """Return as news that a valve is not monitored any more."""
    text = 'nothing judges this valve: check driver, network and detector'
    return News(
        judgement.valve, judgement.actuator, judgement.area, SILENT, judgement.ne107, text, when
    )


def read_rules(config: Section, targets: Iterable[str]) -> list[Rule]:
    """
    Read the rules.

    :param config: with `rules`.
    :param targets: names that rules may use.
    :return: the rules; mistakes are noted in `config`.
    """
    known = tuple(targets)
    rules = []
    for entry in config.listed('rules'):
        rules.append(
            Rule(
                _some(entry, 'to', known, ()),
                _some(entry, 'classes', CLASSES, CLASSES[1:]),
                _some(entry, 'what', (*TRANSITIONS, SILENT), USUAL),
                tuple(entry.texts('valves')) or ('*',),
                tuple(entry.texts('areas')),
                _time(entry, 'from', time.min),
                _time(entry, 'until', time.max),
                _some(entry, 'days', DAYS, DAYS),
                entry.number('debounce', 0.0, 0.0, 86_400.0),
                entry.number('digest', 0.0, 0.0, 86_400.0),
            )
        )
        if not rules[-1].targets:
            entry.problems.append(f'{entry.where}.to: name targets: {", ".join(known)}')
        entry.done()
    if not rules:
        config.problems.append('rules: give at least one, such as - {to: [NAME OF A TARGET]}')
    return rules


def _some(
    entry: Section, name: str, allowed: tuple[str, ...], default: tuple[str, ...]
) -> tuple[str, ...]:
    given = tuple(entry.texts(name))
    for each in given:
        if each not in allowed:
            word = 'an address' if ':' in each else repr(each[:30])  # the former has secrets
            entry.refuse(name, f'{word} is not one of {", ".join(allowed)}')
    return given or default


def _time(entry: Section, name: str, default: time) -> time:
    text = entry.text(name)
    try:
        return time.fromisoformat(text) if text else default
    except ValueError:
        entry.refuse(name, "is no time of day: write '06:30', with quotes")
        return default
