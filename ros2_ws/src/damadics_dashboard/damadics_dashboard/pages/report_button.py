# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The button that leads to a report on paper."""

from urllib.parse import quote

from nicegui import ui

from damadics_dashboard.pages.elements import button, markup
from damadics_dashboard.words.texts import Texts

PERIODS = (1, 7, 30, 365)  # days
KINDS = ('pdf', 'html', 'csv')
TRENDS = 'trends'  # of one valve


def report_button(valve: str, t: Texts) -> None:
    """
    Draw the button: a row for each period, with a link for each form.

    :param valve: name of the valve, `FLEET` for all.
    :param t: the words.
    """
    with button(t('report'), lambda: None) as opener:
        opener.props('icon-right=expand_more')
        with ui.menu().props('auto-close'):
            markup('report_menu.html', rows=[_row(valve, days, t) for days in PERIODS])


def _row(valve: str, days: int, t: Texts) -> dict[str, object]:
    period = t('report_days', days=days) if days > 1 else t('report_day')
    kinds = KINDS if valve == 'FLEET' else (*KINDS, TRENDS)
    place = f'/report?of={quote(valve or "~root", safe="")}&days={days}&as='
    links = [
        {
            'kind': t(f'report_{kind}'),
            'key': f'{kind}-{days}',
            'address': place + kind,
            'words': f'{t(f"report_{kind}")}, {period}',
        }
        for kind in kinds
    ]
    return {'period': period, 'links': links}
