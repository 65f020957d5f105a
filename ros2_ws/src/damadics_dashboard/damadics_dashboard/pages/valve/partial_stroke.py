# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Small strokes that a person may ask a valve for, where its detector allows them."""

from damadics_msgs.srv import PartialStroke
from nicegui import ui

from damadics_dashboard.live.valve import Valve
from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.actions import Dialog, call
from damadics_dashboard.pages.elements import with_values
from damadics_dashboard.words.texts import Texts

SERVICE = 'partial_stroke'
MOST = 20  # strokes of one request
USUAL = 5


class StrokeItem:
    """
    The entry of the menu of actions: it asks for strokes, ends them, or says why it cannot.

    :param watcher: the ROS side.
    :param valve: the valve.
    :param t: the words.
    """

    def __init__(self, watcher: Watcher, valve: Valve, t: Texts) -> None:
        self._watcher = watcher
        self._valve = valve
        self._t = t
        self._under_way = False
        with ui.menu_item(on_click=self._ask) as self._item, ui.item_section():
            self._name = ui.item_label(t(SERVICE))
            self._why = ui.item_label('').classes('why-not').props('caption')
        with_values(self._item, role='menuitem')
        self.update()

    def update(self) -> None:
        """Follow what the detector tells."""
        t, told = self._t, self._valve.diagnostics.get('detector', {})
        state = told.get('Partial strokes', '')
        why = ''
        if not self._watcher.offers(self._valve.name, SERVICE):
            why = t('stroke_not_allowed' if self._valve.fleet else 'stroke_no_service')
        elif state == 'not allowed':
            why = t('stroke_not_allowed')
        self._under_way = state == 'under way' or self._valve.stroking
        self._name.set_text(t('stroke_end' if self._under_way else SERVICE))
        self._why.set_text(why)
        self._why.set_visibility(bool(why))
        if self._item.props.get('disable') != bool(why):
            with_values(self._item, disable=bool(why), aria_disabled=str(bool(why)).lower())

    async def _ask(self) -> None:
        if self._under_way:
            await self._send(amplitude=0.0, count=0)
            return
        t = self._t
        limit = self._valve.diagnostics.get('detector', {}).get('Partial stroke limit (%)', '')
        most = float(limit) if limit.replace('.', '', 1).isdigit() else 10.0

        def fields() -> dict[str, ui.number]:
            amplitude = ui.number(
                t('stroke_amplitude', most=t.number(most)),
                value=min(5.0, most), min=0.1, max=most, step=0.5,
            )  # fmt: skip
            count = ui.number(
                t('stroke_count', most=MOST), value=USUAL, min=1, max=MOST, precision=0
            )
            return {'amplitude': amplitude, 'count': count}

        Dialog(t, SERVICE, self._send_percent, fields)

    async def _send_percent(
        self, amplitude: float | None, count: float | None, **who: str
    ) -> bool:
        return await self._send(amplitude=(amplitude or 0.0) / 100.0, count=int(count or 0), **who)

    async def _send(self, **request: str | float) -> bool:
        return await call(self._watcher, self._valve.name, SERVICE, PartialStroke, **request)
