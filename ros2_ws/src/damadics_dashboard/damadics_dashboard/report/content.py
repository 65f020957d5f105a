# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a report says: of one valve, or of the whole fleet, over a period."""

import math
from collections import Counter
from dataclasses import dataclass, field

from damadics_fd.store.intervals import TRENDED, Intervals, Series
from damadics_msgs.msg import FaultEvent

from damadics_dashboard.report.signature import SignatureLines, signature_lines
from damadics_dashboard.store.history import History, Wanted
from damadics_dashboard.store.rows import ActionRow, EventRow
from damadics_dashboard.words.answers import result_words
from damadics_dashboard.words.findings import found_by, headline
from damadics_dashboard.words.outlook import outlook_words, value_words
from damadics_dashboard.words.texts import DASH, Texts
from damadics_dashboard.words.valve_words import TRANSITIONS, history_rows

DAY = 86400.0
MOST_EVENTS = 5000
LISTED = 40  # events and actions on the page; the CSV has all
WORST = 10
MANAGEABLE = 150.0  # alarms a day and operator, EEMUA 191: "very likely to be acceptable"
OVERLOAD = 300.0  # "maximum manageable"


@dataclass
class Alarm:
    """One occurrence of an alarm, from its first event to its last."""

    raised: float  # s
    cleared: float = math.nan
    level: int = 0
    last: EventRow = field(default_factory=EventRow)  # the event that says most


@dataclass
class Report:
    """A report as text and numbers, whatever its form."""

    title: str
    subtitle: str
    facts: list[tuple[str, str]]
    summary: list[str]
    tables: list[tuple[str, list[str], list[list[str]]]]
    trends: list[tuple[str, str, Series, tuple[float, ...]]]  # name, quantity, curve, limits
    footer: str
    events: list[EventRow]
    signature: SignatureLines | None = None


class Sources:
    """
    Where reports take their content from.

    :param history: transitions and actions.
    :param intervals: trends.
    """

    def __init__(self, history: History, intervals: Intervals) -> None:
        self.history = history
        self.intervals = intervals

    def valves(self) -> list[str]:
        """
        List what there is something to report of.

        :return: names of valves.
        """
        return sorted({*self.history.valves(), *self.intervals.valves()})

    def tag(self, valve: str) -> str:
        """
        Return the tag of a valve's actuator.

        :param valve: name of the valve.
        :return: tag, '' where it is not known or says no more than the name.
        """
        tag = self.history.tags().get(valve, '')
        return '' if tag == valve else tag


def alarms_of(events: list[EventRow]) -> list[Alarm]:
    """
    Put the transitions of a valve together.

    :param events: newest first, as the history returns them.
    :return: alarms, oldest first.
    """
    found: list[Alarm] = []
    for event in reversed(events):
        kind = event['transition']
        if kind == FaultEvent.RAISED:
            found.append(Alarm(event['seen'], level=event['level'], last=event))
        elif found and kind == FaultEvent.CHANGED:
            found[-1].level = max(found[-1].level, event['level'])
            found[-1].last = event
        elif found and kind == FaultEvent.CLEARED and math.isnan(found[-1].cleared):
            found[-1].cleared = event['seen']
    return found


def known_for(sources: Sources, valve: str, since: float, until: float) -> float:
    """
    Return for how much of a period a valve has been known.

    :param sources: history and trends.
    :param valve: its name.
    :param since: begin of the period [s].
    :param until: its end [s].
    :return: [s]; a valve of which nothing is known has no alarm either.
    """
    first, _ = sources.intervals.span(valve) or (math.inf, math.inf)
    first = min(first, sources.history.first_seen(valve))
    return max(until - max(since, first), 0.0)


def reliability(alarms: list[Alarm], span: float) -> tuple[float, float]:
    """
    Return mean time between failures and mean time to repair.

    :param alarms: of all valves.
    :param span: for which they have been known, all together [s].
    :return: MTBF and MTTR [s]; inf and NaN without an alarm.
    """
    repaired = [a.cleared - a.raised for a in alarms if math.isfinite(a.cleared)]
    mttr = sum(repaired) / len(repaired) if repaired else math.nan
    down = sum(repaired)
    mtbf = max(span - down, 0.0) / len(alarms) if alarms else math.inf
    return mtbf, mttr


def valve_report(sources: Sources, valve: str, since: float, until: float, t: Texts) -> Report:
    """
    Report on one valve.

    :param sources: history and trends.
    :param valve: its name.
    :param since: begin of the period [s].
    :param until: its end [s].
    :param t: the words.
    :return: the report.
    """
    wanted = Wanted(valve=valve, since=since, until=until)
    events = sources.history.find(wanted, MOST_EVENTS)
    actions = sources.history.actions(wanted, MOST_EVENTS)
    alarms = alarms_of(events)
    mtbf, mttr = reliability(alarms, known_for(sources, valve, since, until))
    last = alarms[-1] if alarms else None
    summary = [t('report_quiet')]
    if last is not None:
        what, numbers, advice = headline(last.last, t)
        summary = [f'{what} {numbers}'.strip(), advice, found_by(last.last, t)]
    trends = []
    for quantity in TRENDED:
        found = sources.intervals.series(valve, quantity, since, until)
        if len(found.start):
            limits = t.causes.limits.get(quantity, ())
            trends.append((t(f'trend_{quantity}'), quantity, found, tuple(limits)))
    measured = max((len(x[2].start) * x[2].length for x in trends), default=0.0)
    rows = [
        [
            t(f'trend_{q}'),
            value_words(q, float(s.mean[0]), t),
            value_words(q, float(s.mean[-1]), t),
            value_words(q, float(s.least.min()), t),
            value_words(q, float(s.greatest.max()), t),
            outlook_words(q, s, limits, until, t) if limits else '',
        ]
        for _, q, s, limits in trends
    ]
    heads = [t(k) for k in ('quantity', 'at_begin', 'at_end', 'least', 'greatest', 'outlook')]
    tables = [
        (t('trend_title'), heads, rows),
        (t('alarms'), _heads(t), [_event(event, t) for event in events[:LISTED]]),
        (
            t('operator_actions'),
            [t(k) for k in ('time', 'action', 'who', 'comment', 'result')],
            [_action(row, t) for row in actions[:LISTED]],
        ),
    ]
    tag = sources.tag(valve)
    return Report(
        t('report_title', what=f'{valve or "valve"} {tag}'.strip()),
        _period(since, until, t),
        [
            (t('valve'), valve or 'valve'),
            *([(t('tag'), tag)] if tag else []),
            (t('alarms'), str(len(alarms))),
            (t('mtbf'), t.duration(mtbf)),
            (t('mttr'), t.duration(mttr)),
            (t('measured_time'), t.duration(min(measured, until - since)) if trends else DASH),
        ],
        [line for line in summary if line],
        tables,
        trends,
        t('report_footer'),
        events,
        signature_lines([(quantity, found) for _, quantity, found, _ in trends]),
    )


def fleet_report(sources: Sources, since: float, until: float, t: Texts) -> Report:
    """
    Report on all valves.

    :param sources: history and trends.
    :param since: begin of the period [s].
    :param until: its end [s].
    :param t: the words.
    :return: the report.
    """
    valves = sources.valves()
    rows: list[tuple[int, int, list[str]]] = []
    alarms: list[Alarm] = []
    everything: list[EventRow] = []
    together = 0.0
    for valve in valves:
        events = sources.history.find(Wanted(valve=valve, since=since, until=until), MOST_EVENTS)
        everything += events
        mine = alarms_of(events)
        alarms += mine
        known = known_for(sources, valve, since, until)
        together += known
        mtbf, mttr = reliability(mine, known)
        what = headline(mine[-1].last, t)[0] if mine else t('report_quiet')
        worst = max((a.level for a in mine), default=0)
        name = f'{valve or "valve"} {sources.tag(valve)}'.strip()
        row = [name, str(len(mine)), t.duration(mtbf), t.duration(mttr), what]
        rows.append((worst, len(mine), row))
    rows.sort(key=lambda r: (-r[0], -r[1], r[2][0]))
    mtbf, mttr = reliability(alarms, together)
    days = max((until - since) / DAY, 1e-9)
    a_day = len(alarms) / days
    verdict = 'eemua_good' if a_day <= MANAGEABLE else 'eemua_limit'
    verdict = 'eemua_bad' if a_day > OVERLOAD else verdict
    counts = Counter(t(TRANSITIONS[e['transition']]) for e in everything if e['transition'] < 8)
    heads = [t('valve'), t('alarms'), t('mtbf'), t('mttr'), t('latest_finding')]
    return Report(
        t('report_fleet'),
        _period(since, until, t),
        [
            (t('valves').capitalize(), str(len(valves))),
            (t('alarms'), str(len(alarms))),
            (t('alarms_a_day'), t.number(a_day)),
            (t('mtbf'), t.duration(mtbf)),
            (t('mttr'), t.duration(mttr)),
        ],
        [t(verdict, number=t.number(a_day))],
        [
            (t('worst_ten'), heads, [row for _, _, row in rows[:WORST]]),
            (t('transitions'), [t('what'), t('number')], [[k, str(n)] for k, n in counts.items()]),
        ],
        [],
        t('report_footer'),
        sorted(everything, key=lambda e: -e['seen']),
    )


def _heads(t: Texts) -> list[str]:
    return [t(k) for k in ('time', 'what', 'peak', 'text')]


def _event(event: EventRow, t: Texts) -> list[str]:
    (row,) = history_rows([event], t)
    words = f'{row["text"]} {row["more"]}'.strip()
    return [str(row['moment']), str(row['what']), str(row['ratio']), words]


def _action(row: ActionRow, t: Texts) -> list[str]:
    key = f'action_{row["action"]}'
    return [
        t.moment(int(row['seen'] * 1e9)),
        t.entries.get(key, row['action']),
        row['user'] or t('nobody'),
        row['comment'] or '',
        result_words(row, t),
    ]


def _period(since: float, until: float, t: Texts) -> str:
    return f'{t.moment(int(since * 1e9))} – {t.moment(int(until * 1e9))}'
