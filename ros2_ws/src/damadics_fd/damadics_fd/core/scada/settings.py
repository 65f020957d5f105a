# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the SCADA-rate monitor."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from damadics_fd.core.settings.control_room import LEAST_LEARNING, WIDE_PLAY
from damadics_fd.core.valve.parameters import Valve


@dataclass(frozen=True)
class ScadaSettings:
    """
    What a user states; everything else is learned from the fault-free record.

    :param period_s: sample period the monitor works at; faster input is thinned to it.
    :param t_on_s: no test before this time since the first sample.
    :param learn_from_s: start of the learning record since the first sample.
    :param learn_s: end of it; without a given reference monitoring starts there.
    :param days_per_false_alarm: false-alarm budget of the whole bank.
    :param sigma: standard deviation of the sensor noise, share of full scale.
    :param wide_play: play of the second model of the friction test, share of stroke.
    :param gap_s: longest gap the models are carried over; a longer one restarts them.
    :param settle_s: no test for this time after such a restart, none of r1 after a jump of CV
        such as the fault-free record does not show: when within the period it came is not known.
    :param saturated: no flow test while the model's flow is above the second of these limits and
        both F' and f are above the first: the flow meter shows no more than its range.
    :param flow_range: end of the flow meter's range, share of 40 t/h; None: learned.
    :param medium: 0 liquid, 1 gas or steam; None: whichever the record fits better.
    :param kv_stated: the actuator's valve coefficient is that of this valve, not a default.
    :param actuator: nominal parameters.
    """

    period_s: float = 1.0
    t_on_s: float = 300.0
    learn_from_s: float = 60.0
    learn_s: float = 900.0
    days_per_false_alarm: float = 30.0
    sigma: float = 0.001414
    wide_play: float = WIDE_PLAY
    gap_s: float = 30.0
    settle_s: float = 120.0
    saturated: tuple[float, float] = (0.94, 0.97)
    flow_range: float | None = None
    medium: int | None = None
    kv_stated: bool = False
    actuator: Valve = field(default_factory=Valve)

    def __post_init__(self) -> None:
        """Refuse values that make no monitor, all of them in one message."""
        wrong = [
            f'{name} is {value}: give more than {low:g}'
            for name, value, low in (
                ('period_s', self.period_s, 0.0),
                ('learn_s', self.learn_s, self.learn_from_s + LEAST_LEARNING),
                ('days_per_false_alarm', self.days_per_false_alarm, 0.0),
                ('sigma', self.sigma, 0.0),
                ('wide_play', self.wide_play, self.actuator.stem_play),
            )
            if not value > low
        ]
        if wrong:
            raise ValueError('; '.join(wrong))

    def record(self) -> np.ndarray:
        """Return what the compiled step reads, as a structured array of length 1."""
        values = np.zeros(1, SETTINGS)
        values['act'] = self.actuator.record()
        for name in ('period_s', 't_on_s', 'sigma', 'wide_play', 'gap_s', 'settle_s'):
            values[name] = getattr(self, name)
        values['flow_high'], values['model_high'] = self.saturated
        return values


class ScadaConfig(Protocol):
    """What the compiled step reads of the settings."""

    act: Valve
    period_s: float
    t_on_s: float
    sigma: float
    wide_play: float
    gap_s: float
    settle_s: float
    flow_high: float
    model_high: float


SETTINGS = np.dtype(
    (
        np.record,
        [
            ('act', Valve().record().dtype),
            *(
                (name, np.float64)
                for name in ('period_s', 't_on_s', 'sigma', 'wide_play', 'gap_s', 'settle_s')
            ),
            ('flow_high', np.float64),
            ('model_high', np.float64),
        ],
    )
)
