# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The button that leads to a report on paper."""

from urllib.parse import quote

from nicegui import ui

from damadics_dashboard.pages.elements import button, with_values
from damadics_dashboard.words.texts import Texts

PERIODS = (1, 7, 30, 365)  # days


def report_button(valve: str, t: Texts) -> None:
    """
    Draw the button.

    :param valve: name of the valve, `FLEET` for all.
    :param t: the words.
    """
    with button(t('report'), lambda: None) as opener:
        opener.props('icon-right=expand_more')
        with ui.menu():
            for kind in ('pdf', 'html', 'csv'):
                for days in PERIODS:
                    place = f'/report?of={quote(valve or "~root", safe="")}&days={days}&as={kind}'
                    text = t('report_of', kind=kind.upper(), days=days)
                    item = ui.menu_item(text, on_click=lambda p=place: ui.navigate.to(p, True))
                    with_values(item, data_report=f'{kind}-{days}')
