# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small pieces of HTML; every text from outside is escaped here."""

import math
from collections.abc import Iterable
from html import escape
from typing import Any
from urllib.parse import quote

from damadics_msgs.msg import FaultEvent

from damadics_dashboard.valve import NE107, Alarm, Condition, Valve, age, moment

# NAMUR NE 107: a form, a colour and a letter each, so that nobody has to see the colour
FORMS = {
    'F': '<circle cx="14" cy="14" r="13"/>',
    'C': '<path d="M1 3h26L14 26z"/>',
    'S': '<path d="M14 1.5 27 25H1z"/>',
    'M': '<path d="M14 .5 27.5 14 14 27.5.5 14z"/>',
    'ok': '<circle cx="14" cy="14" r="12" fill="none" stroke="currentColor" stroke-width="2"/>'
    '<path d="m8.5 14.5 4 4 7-8.5" fill="none" stroke="currentColor" stroke-width="2.6" '
    'stroke-linecap="round" stroke-linejoin="round"/>',
    'learn': '<circle cx="14" cy="14" r="12" fill="none" stroke="currentColor" stroke-width="2" '
    'stroke-dasharray="4 3.5"/><circle cx="14" cy="14" r="4"/>',
    'off': '<circle cx="14" cy="14" r="12" fill="none" stroke="currentColor" stroke-width="2"/>'
    '<path d="M8 14h12" stroke="currentColor" stroke-width="2.6" stroke-linecap="round"/>',
}
LETTER_AT = {'F': 18.3, 'C': 14.5, 'S': 22.0, 'M': 18.3}
TRANSITIONS = {
    FaultEvent.RAISED: 'raised',
    FaultEvent.CLEARED: 'cleared',
    FaultEvent.ACKNOWLEDGED: 'acknowledged',
    FaultEvent.RESET: 'reset',
    FaultEvent.SHELVED: 'shelved',
    FaultEvent.UNSHELVED: 'unshelved',
    FaultEvent.NEAR_MISS: 'near miss',
    FaultEvent.CHANGED: 'changed',
}


def symbol(kind: str, more: str = '') -> str:
    """
    Draw the symbol of a condition.

    :param kind: F, C, S, M, ok, learn or off.
    :param more: further CSS classes.
    :return: HTML.
    """
    letter = ''
    if kind in LETTER_AT:
        letter = f'<text x="14" y="{LETTER_AT[kind]}">{kind}</text>'
    return (
        f'<span class="ne {kind} {more}" aria-hidden="true"><svg viewBox="0 0 28 28" '
        f'fill="currentColor">{FORMS[kind]}{letter}</svg></span>'
    )


def number(value: float | None, unit: str = '', digits: int = 3) -> str:
    """
    Word a number.

    :param value: the number.
    :param unit: its unit.
    :param digits: significant digits.
    :return: text, a dash where there is no number.
    """
    if value is None or not math.isfinite(value):
        return '–'
    return f'{value:.{digits}g}' + (f' {unit}' if unit else '')


def spark(ratios: Iterable[float]) -> str:
    """
    Draw the course of residual / threshold, the largest of every second; log 0.01 .. 100.

    :param ratios: oldest first.
    :return: an SVG.
    """
    heights = [
        38.0 - 38.0 * min(max((math.log10(max(r, 1e-9)) + 2.0) / 4.0, 0.0), 1.0) for r in ratios
    ]
    points = ' '.join(
        f'{200.0 * n / max(len(heights) - 1, 1):.1f},{y:.1f}' for n, y in enumerate(heights)
    )
    limit = 38.0 - 38.0 * 2.0 / 4.0
    return (
        f'<svg class="spark" viewBox="0 0 200 38" preserveAspectRatio="none" '
        f'aria-hidden="true"><line class="limit" x1="0" x2="200" y1="{limit:.1f}" '
        f'y2="{limit:.1f}"/><polyline class="curve" points="{points}"/></svg>'
    )


def tile(valve: Valve, now: float) -> str:
    """
    Draw a valve for the overview.

    :param valve: the valve.
    :param now: monotonic time [s].
    :return: HTML.
    """
    condition = valve.condition(now)
    old = valve.age(now)
    alarm = valve.alarm()
    why = condition.detail
    if alarm is not None and alarm.evidence:
        why = alarm.evidence['text'].removeprefix(f'{valve.tag}: ')
    ratio = 0.0
    if valve.flag is not None and valve.flag.threshold > 0.0:
        ratio = valve.flag.residual / valve.flag.threshold
    badge = ''
    if condition.kind == 'off' and alarm is not None:
        badge = '<span class="tag hot">alarm before the silence</span>'
    elif alarm is not None:
        badge = (
            '<span class="tag done">acknowledged</span>'
            if alarm.acknowledged
            else '<span class="tag hot">unacknowledged</span>'
        )
    meter = ''
    if condition.kind == 'learn':
        percent = 100.0 * valve.progress
        meter = (
            f'<div class="meter" role="progressbar" aria-label="learning" '
            f'aria-valuemin="0" aria-valuemax="100" aria-valuenow="{percent:.0f}">'
            f'<i style="width:{percent:.1f}%"></i></div>'
        )
    name = escape(valve.title)
    tag = f' · {escape(valve.tag)}' if valve.tag and valve.tag != valve.title else ''
    label = escape(f'{valve.title}: {condition.title}, {condition.detail}', quote=True)
    fresh = 'never' if old is None else age(old)
    return (
        f'<a class="tile {condition.kind}" href="{address(valve.name)}" aria-label="{label}" '
        f'data-valve="{escape(valve.name, quote=True)}" data-kind="{condition.kind}">'
        f'<span class="top">{symbol(condition.kind)}<span><span class="name">{name}</span>'
        f'<span class="sub">{tag}</span><br><span class="state"><b>{escape(condition.title)}</b> '
        f'{badge}</span></span></span>'
        f'{spark(valve.ratios)}{meter}<span class="why">{escape(why)}</span>'
        f'<span class="facts"><span>residual <b>{ratio:.2f}</b> × limit</span>'
        f'<span>last sample <b>{fresh}</b></span></span></a>'
    )


def address(name: str) -> str:
    """
    Return the address of a valve's page.

    :param name: name of the valve.
    :return: path.
    """
    return '/valve/' + quote(name or '~root', safe='')


def banner(valve: Valve, condition: Condition, now: float) -> str:
    """
    Draw the head of a valve's page.

    :param valve: the valve.
    :param condition: its condition.
    :param now: monotonic time [s].
    :return: HTML.
    """
    flag = valve.flag
    ratio = flag.residual / flag.threshold if flag is not None and flag.threshold > 0.0 else None
    rate = f'{1.0 / valve.period:.0f}' if valve.period > 0.0 else '–'
    old = valve.age(now)
    figures = [
        ('residual / limit', number(ratio, '', 2)),
        ('last sample', '–' if old is None else f'{age(old)} <small>ago</small>'),
        ('samples', f'{rate} <small>Hz</small>'),
        ('learned', f'{100.0 * valve.progress:.0f} <small>%</small>'),
        ('lost', f'{valve.lost}'),
    ]
    shown = ''.join(f'<span class="figure">{name}<b>{value}</b></span>' for name, value in figures)
    return (
        f'<div class="banner {condition.kind}" data-kind="{condition.kind}" role="status">'
        f'{symbol(condition.kind, "big")}<span class="words"><span class="title">'
        f'{escape(condition.title)}</span><br><span class="sub">{escape(condition.detail)}</span>'
        f'</span><span class="figures">{shown}</span></div>'
    )


def alarm_body(valve: Valve, alarm: Alarm, *, name: bool) -> str:
    """
    Draw an alarm with its evidence.

    :param valve: the valve.
    :param alarm: its alarm.
    :param name: whether to name the valve.
    :return: HTML.
    """
    e = alarm.evidence
    who = f'{escape(valve.title)} · ' if name else ''
    cause = (e.get('cause') or 'cause unknown').replace('_', ' ')
    seen = (
        '<span class="tag done">acknowledged</span>'
        if alarm.acknowledged
        else '<span class="tag hot">unacknowledged</span>'
    )
    words = NE107.get(alarm.level, ('', 'shelved'))[1]
    cells = [
        ('onset', moment(alarm.onset)),
        ('residual', number(e.get('residual'), '1/s')),
        ('threshold', number(e.get('threshold'), '1/s')),
        ('peak ratio', number(e.get('ratio'), '×')),
        ('duration', age(e.get('duration'))),
        ('confidence', _percent(e.get('confidence'))),
        ('strength', number(e.get('strength'))),
    ]
    grid = ''.join(f'<div>{label}<b>{value}</b></div>' for label, value in cells if value != '–')
    return (
        f'<div><b class="t">{who}Alarm {alarm.occurrence}: {escape(cause)}</b> '
        f'<span class="tag">{escape(words)}</span> <span class="tag">{alarm.state}</span> {seen}'
        f'</div><div>{escape(e.get("text", "evidence not received"))}</div>'
        f'<div class="sub">{escape(e.get("advice", ""))}</div>'
        f'<div class="evidence">{grid}</div>'
    )


def alarm_kind(alarm: Alarm) -> str:
    """
    Return the NE 107 letter of an alarm.

    :param alarm: the alarm.
    :return: F, C, S or M.
    """
    return NE107.get(alarm.level, ('C', ''))[0] or 'M'


def history_table(rows: list[dict[str, Any]], *, name: bool) -> str:
    """
    Draw transitions as a table.

    :param rows: as the history returns them.
    :param name: whether to name the valve.
    :return: HTML.
    """
    if not rows:
        return '<p class="empty">Nothing has happened yet.</p>'
    lines = []
    for row in rows:
        kind = NE107.get(row['level'], ('', ''))[0] or 'ok'
        who = (
            f'<td class="nowrap"><a href="{address(row["valve"])}">'
            f'{escape(row["valve"] or "valve")}</a></td>'
            if name
            else ''
        )
        lines.append(
            f'<tr><td class="nowrap">{moment(row["stamp"])}</td>{who}'
            f'<td class="nowrap">{symbol(kind)}</td>'
            f'<td class="nowrap">{TRANSITIONS.get(row["transition"], "?")}</td>'
            f'<td class="num">{row["occurrence"] or ""}</td>'
            f'<td class="num">{number(row["ratio"], "×")}</td>'
            f'<td>{escape(row["text"])}</td></tr>'
        )
    who = '<th scope="col">valve</th>' if name else ''
    return (
        '<div class="scroll" tabindex="0" role="region" aria-label="alarm history">'
        '<table class="list"><caption class="unseen">alarm history, newest first</caption><thead>'
        f'<tr><th scope="col">time</th>{who}<th scope="col">class</th><th scope="col">transition'
        '</th><th scope="col">alarm</th><th scope="col">peak</th><th scope="col">what</th></tr>'
        f'</thead><tbody>{"".join(lines)}</tbody></table></div>'
    )


def _percent(share: float | None) -> str:
    return '–' if share is None else f'{100.0 * share:.0f} %'
