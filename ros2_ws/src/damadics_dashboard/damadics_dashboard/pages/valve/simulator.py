# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Faults of a simulated plant, apart from what is done to a real valve."""

from collections.abc import Awaitable, Callable

from damadics_msgs.msg import FaultState
from damadics_msgs.srv import InjectFault
from nicegui import ui

from damadics_dashboard.live.valve import Valve
from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.pages.actions import call
from damadics_dashboard.pages.elements import box, button, with_values
from damadics_dashboard.words.texts import Texts

DEVELOPMENTS = (0.0, 20.0, 300.0)
FAULTS = {
    getattr(FaultState, name): name
    for name in dir(FaultState)
    if name.startswith('F') and name[1:2].isdigit()
}


def simulator_panel(watcher: Watcher, valve: Valve, t: Texts) -> None:
    """
    Draw a button for each fault of the simulated plant.

    :param watcher: the ROS side.
    :param valve: the valve.
    :param t: the words.
    """
    with box('details', 'card simulator', aria_label=t('simulated_plant')) as details:
        details.props('open')
        with box('summary'):
            ui.label(t('simulated_plant')).classes('simulator-title')
            ui.label(t('simulated_plant_text')).classes('sub')
        with box('div', 'row simulator-row'):
            strength = ui.number(
                t('strength'), value=1.0, min=-1.0, max=1.0, step=0.05, format='%.2f'
            )
            strength.props('dense outlined').classes('strength')
            choices = {s: t('over_time', time=t.duration(s)) for s in DEVELOPMENTS}
            choices[0.0] = t('abrupt')
            development = ui.select(choices, value=0.0, label=t('development'))
            development.props('dense outlined').classes('development')

            async def clear() -> None:
                await call(watcher, valve.name, 'inject_fault', InjectFault, fault=0)

            button(t('clear_faults'), clear, icon='healing')

        def inject(fault: int) -> Callable[[], Awaitable[None]]:
            async def act() -> None:
                await call(
                    watcher,
                    valve.name,
                    'inject_fault',
                    InjectFault,
                    fault=fault,
                    strength=float(strength.value or 0.0),
                    development=float(development.value),
                )

            return act

        with box('div', 'faults'):
            for fault, name in sorted(FAULTS.items()):
                number = name.partition('_')[0]
                text = f'{number.lower()}  {t(f"fault_{fault}")}'
                with_values(
                    button(text, inject(fault)),
                    aria_label=f'{t("inject")} {fault}: {t(f"fault_{fault}")}',
                )
