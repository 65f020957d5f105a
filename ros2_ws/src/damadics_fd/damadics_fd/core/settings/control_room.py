# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of mode scada: a control room's signals."""

from dataclasses import dataclass

from damadics_fd.core.field import Section, number

SCADA = ('scada',)
LEAST_LEARNING = 239.0  # s between t_w and t_learn
WIDE_PLAY = 0.03  # of the stroke; of the second model of the friction test


@dataclass(frozen=True, eq=False, repr=False)
class ControlRoom(Section):
    """Tune the monitor of a control room's signals."""

    false_alarm_days: float = number(
        'd', 'mode scada: days per false alarm', 0.01, 1e5, 30.0, modes=SCADA
    )
    sensor_noise: float = number(
        '',
        'mode scada: standard deviation of the sensors / full scale',
        1e-6,
        0.1,
        1.414e-3,
        modes=SCADA,
    )
