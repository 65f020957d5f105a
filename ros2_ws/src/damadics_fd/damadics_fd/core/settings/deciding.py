# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the decision: M of N samples, delays, latch, levels, end-stop gates."""

from dataclasses import dataclass

from damadics_fd.core.field import Section, number, switch, whole

GATING = ('monitor', 'scada')


@dataclass(frozen=True, eq=False, repr=False)
class Deciding(Section):
    """Tune when a residual becomes an alarm, and how long it stays one."""

    decide_m: int = whole(
        '', 'samples over the threshold that make a decision ...', 1, 64, 2, scada=1
    )
    decide_n: int = whole('', '... out of this number of latest samples', 1, 64, 2, scada=1)
    on_delay: float = number(
        's', 'time a decision lasts before it raises the alarm', 0.0, 3600.0, 0.0
    )
    off_delay: float = number(
        's',
        'time without decision before the condition counts as gone',
        0.0,
        86400.0,
        5.0,
        paper=0.0,
    )
    latch: bool = switch('keep the alarm until it is reset', True, paper=False)
    level_maintenance: float = number(
        '', 'residual/threshold of "maintenance required"', 1.0, 1e6, 1.0
    )
    level_specification: float = number(
        '', 'residual/threshold of "out of specification"', 1.0, 1e6, 1.5
    )
    level_failure: float = number('', 'residual/threshold of "failure"', 1.0, 1e6, 2.5)
    chatter: int = whole('1/min', 'alarms per minute that count as chatter', 2, 16, 3)
    gate_low: float = number(
        '',
        'stem closer to the open stop: a push from the stop is ignored',
        0.0,
        0.5,
        0.01,
        paper=0.0,
        scada=0.0,
        modes=GATING,
    )
    gate_high: float = number(
        '',
        'stem closer to the closed stop: nothing is decided or learned',
        0.0,
        0.5,
        0.03,
        paper=0.0,
        scada=0.0,
        modes=GATING,
    )
