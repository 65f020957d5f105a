# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What an operator can do to a valve: buttons that call its services."""

from collections.abc import Awaitable, Callable
from typing import Any

from damadics_msgs.msg import FaultState
from damadics_msgs.srv import (
    Acknowledge,
    InjectFault,
    Reference,
    Relearn,
    ResetAlarm,
    Shelve,
)
from nicegui import ui

from damadics_dashboard.valve import Valve
from damadics_dashboard.watcher import ServiceError, Watcher

SHELVES = {600.0: '10 minutes', 3600.0: '1 hour', 8 * 3600.0: '8 hours', 86400.0: '1 day'}
DEVELOPMENTS = {0.0: 'abrupt', 20.0: 'over 20 s', 300.0: 'over 5 min'}
FAULTS = {
    getattr(FaultState, name): name
    for name in dir(FaultState)
    if name.startswith('F') and name[1:2].isdigit()
}


async def call(watcher: Watcher, valve: str, service: str, kind: Any, **request: Any) -> bool:
    """
    Call a service and show its answer.

    :param watcher: the ROS side.
    :param valve: name of the valve.
    :param service: its name.
    :param kind: its type.
    :param request: its fields.
    :return: whether it was done.
    """
    try:
        done, text = await watcher.call(valve, service, kind, **request)
    except ServiceError as problem:
        done, text = False, str(problem)
    ui.notify(
        text,
        type='positive' if done else 'negative',
        position='bottom-right',
        timeout=4000 if done else 9000,
        close_button='Close',
    )
    return done


def _ask(
    title: str,
    explanation: str,
    button: str,
    act: Callable[..., Awaitable[Any]],
    durations: dict[float, str] | None = None,
) -> None:
    """Ask for who and why, then act."""
    with ui.dialog() as dialog, ui.card().classes('w-96').props(f'aria-label="{title}"'):
        ui.label(title).classes('text-lg font-semibold')
        ui.label(explanation).classes('sub')
        duration = (
            ui.select(durations, value=next(iter(durations)), label='For').classes('w-full')
            if durations
            else None
        )
        user = ui.input('Your name').classes('w-full')
        comment = ui.input('Comment').classes('w-full')

        async def done() -> None:
            dialog.close()
            given = {'user': user.value or '', 'comment': comment.value or ''}
            if duration is not None:
                given['duration'] = duration.value
            await act(**given)
            dialog.delete()

        with ui.row().classes('w-full justify-end'):
            ui.button('Cancel', on_click=dialog.close, color=None).props('flat no-caps').classes(
                'plain'
            )
            ui.button(button, on_click=done, color=None).props('no-caps unelevated').classes(
                'main'
            )
    dialog.open()


def alarm_buttons(watcher: Watcher, valve: Valve, occurrence: int) -> ui.button:
    """
    Draw the buttons of an alarm.

    :param watcher: the ROS side.
    :param valve: the valve.
    :param occurrence: number of the alarm.
    :return: the button that acknowledges.
    """
    name = valve.name

    async def acknowledge() -> None:
        await call(watcher, name, 'acknowledge', Acknowledge, occurrence=occurrence)

    def reset() -> None:
        _ask(
            'Reset the alarm',
            'After inspection or repair. It is refused while the fault lasts.',
            'Reset',
            lambda **g: call(watcher, name, 'reset', ResetAlarm, **g),
        )

    def shelve() -> None:
        _ask(
            'Shelve the alarms',
            'Masks this valve for a time; everything is still recorded.',
            'Shelve',
            lambda **g: call(watcher, name, 'shelve', Shelve, **g),
            SHELVES,
        )

    title = valve.title
    with ui.element('div').classes('actions'):
        button = (
            ui.button('Acknowledge', on_click=acknowledge, color=None)
            .props(
                f'no-caps unelevated dense padding="4px 12px" '
                f'aria-label="Acknowledge alarm of {title}"'
            )
            .classes('main')
        )
        for words, act in (('Reset', reset), ('Shelve', shelve)):
            ui.button(words, on_click=act, color=None).props(
                f'no-caps flat dense padding="4px 12px" aria-label="{words} alarm of {title}"'
            ).classes('plain')
    return button


def valve_buttons(watcher: Watcher, valve: Valve) -> None:
    """
    Draw what can be done to a valve at any time.

    :param watcher: the ROS side.
    :param valve: the valve.
    """
    name = valve.name

    def shelve() -> None:
        _ask(
            'Shelve the alarms',
            'Masks this valve for a time; everything is still recorded.',
            'Shelve',
            lambda **g: call(watcher, name, 'shelve', Shelve, **g),
            SHELVES,
        )

    def relearn() -> None:
        _ask(
            'Learn the valve afresh',
            'After a repair. The valve must be free of faults: what it '
            'does now becomes normal. Faults are not reported while it learns.',
            'Relearn',
            lambda **g: call(watcher, name, 'relearn', Relearn, **g),
        )

    async def unshelve() -> None:
        await call(watcher, name, 'shelve', Shelve, duration=0.0)

    async def save() -> None:
        await call(watcher, name, 'save_reference', Reference)

    async def load() -> None:
        await call(watcher, name, 'load_reference', Reference)

    with (
        ui.button('Actions', icon='expand_more', color=None)
        .props('no-caps flat dense padding="4px 12px"')
        .classes('plain'),
        ui.menu(),
    ):
        for words, act in (
            ('Shelve alarms …', shelve),
            ('End shelf', unshelve),
            ('Learn afresh …', relearn),
            ('Save reference', save),
            ('Load reference', load),
        ):
            ui.menu_item(words, on_click=act)


def simulator_panel(watcher: Watcher, valve: Valve) -> None:
    """
    Draw a button for each fault of the simulated plant.

    :param watcher: the ROS side.
    :param valve: the valve.
    """
    with ui.element('section').classes('card w-full').props('aria-label="simulated plant"'):
        with ui.element('div').classes('head'):
            ui.html('<h2>Simulated plant</h2>', sanitize=False)
            ui.label('inject a fault and watch what happens').classes('sub')
        with ui.element('div').classes('row').style('margin: 6px 0 10px'):
            strength = (
                ui.number('Strength', value=1.0, min=-1.0, max=1.0, step=0.05, format='%.2f')
                .props('dense outlined')
                .classes('w-28')
            )
            development = (
                ui.select(DEVELOPMENTS, value=0.0, label='Development')
                .props('dense outlined')
                .classes('w-40')
            )

            async def clear() -> None:
                await call(watcher, valve.name, 'inject_fault', InjectFault, fault=0)

            ui.button('Clear all faults', icon='healing', on_click=clear, color=None).props(
                'no-caps flat padding="6px 14px"'
            ).classes('plain')

        def inject(fault: int) -> Callable[[], Awaitable[None]]:
            async def act() -> None:
                await call(
                    watcher,
                    valve.name,
                    'inject_fault',
                    InjectFault,
                    fault=fault,
                    strength=float(strength.value),
                    development=float(development.value),
                )

            return act

        with ui.element('div').classes('faults'):
            for fault, name in sorted(FAULTS.items()):
                number, _, words = name.partition('_')
                ui.button(
                    f'{number.lower()}  {words.replace("_", " ").lower()}',
                    on_click=inject(fault),
                    color=None,
                ).props(
                    f'no-caps flat dense padding="4px 10px" aria-label="Inject fault {fault}"'
                ).classes('plain')
