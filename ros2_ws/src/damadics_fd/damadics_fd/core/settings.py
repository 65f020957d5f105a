# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""All settings of the estimator and the detector, with unit, range and description of each."""

import math
from collections.abc import Mapping
from dataclasses import Field, asdict, dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from damadics_fd.core.field import choice, number, problem_of, switch, wrong_choice
from damadics_fd.core.modes import MODES

VELOCITIES = ('high_pass', 'kalman', 'super_twisting')
THRESHOLDS = ('paper', 'floor')


class SettingsError(ValueError):
    """
    Tell every error of a set of settings at once.

    :param problems: one sentence per error, naming the setting and the remedy.
    """

    def __init__(self, problems: list[str]) -> None:
        self.problems = problems
        super().__init__('; '.join(problems))


# Mode scada: the tests bring their own limits, so the detector's threshold is 1; see core/scada.
SCADA = {
    'sample_rate': 1.0,
    'rho_min': 1.0,
    'decide_m': 1,
    'decide_n': 1,
    't_on': 300.0,
    't_w': 60.0,
    't_learn': 900.0,
    'gate_low': 0.0,
    'gate_high': 0.0,
    'gap_reset': 30.0,
    'hold': 120.0,
}


# K_m of the plug-force law at 0, 10, .., 90, 99, 100 % of the stroke (DABLib 1.22)
PLUG_TABLE = (1.0, 0.95, 0.90, 0.85, 0.785, 0.725, 0.67, 0.61, 0.555, 0.50, 0.45, 0.40)


@dataclass(frozen=True)
class Settings:
    """
    Hold every number that the estimator and the detector depend on.

    The metadata of a field holds `unit`, `description`, the allowed range `low`..`high` (or
    `choices`) and the `default` of each mode; `describe()` lists them for parameter declarations.

    :raises SettingsError: listing every value that is missing, of a wrong type, out of its
        range or in contradiction to another.

    >>> Settings.for_mode('paper').k2
    400.0
    >>> Settings(k1=-1.0, kappa=0.0)
    Traceback (most recent call last):
    damadics_fd.core.settings.SettingsError: k1 = -1.0 1/s is outside 0.001..1e+06; ...
    """

    mode: str = choice(
        'paper: the printed method; monitor: learn, freeze, detect; '
        "scada: a control room's signals at 1 Hz",
        MODES,
        'paper',
        'monitor',
    )
    sample_rate: float = number(
        'Hz', 'nominal sample rate of the measurement', 0.01, 1e5, 400.0, 200.0
    )

    # velocity estimator
    velocity: str = choice('velocity estimator', VELOCITIES, 'high_pass', 'kalman')
    tau: float = number(
        's', 'time constant of the high-pass velocity filter', 1e-4, 10.0, 0.14, 0.02
    )
    wn: float = number(
        'rad/s', 'bandwidth of the steady-state Kalman filter', 0.1, 1e4, 50.0, 50.0
    )
    lipschitz: float = number(
        '1/s2',
        'bound on the acceleration / stroke for the super-twisting differentiator',
        1e-3,
        1e6,
        20.0,
        20.0,
    )
    consistent: bool = switch(
        'filter position and input with the filter of the velocity', False, True
    )

    # observer and adaptive laws, equations (10)-(15)
    k1: float = number('1/s', 'observer gain on the position error', 1e-3, 1e6, 100.0, 100.0)
    k2: float = number('1/s', 'observer gain on the velocity error', 1e-3, 1e6, 400.0, 400.0)
    coupling: float = number(
        '',
        'weight p of xi1 in the Lyapunov function; the term '
        'alpha5/p xi2 in (10) is left out where p is 0',
        0.0,
        1e9,
        1.0,
        0.0,
    )
    alpha1: float = number('1/s', 'initial alpha1, viscous friction / mass', 0.0, 1e7, 0.0, 750.0)
    alpha4: float = number('1/s2', 'initial alpha4, input gain', 0.0, 1e9, 0.04, 30446.0)
    alpha5: float = number('1/s2', 'initial alpha5, stiffness / mass', 0.0, 1e9, 0.04, 30446.0)
    g1: float = number('', 'adaptation gain of alpha1', 0.0, 1e9, 0.0, 0.0)
    g4: float = number('', 'adaptation gain of alpha4', 0.0, 1e9, 0.0, 0.0)
    g5: float = number('', 'adaptation gain of alpha5', 0.0, 1e9, 0.0, 1000.0)
    gw: float = number(
        '', 'adaptation gain of the weights and bounds in Phi', 0.0, 1e9, 100.0, 500.0
    )
    delta: float = number(
        '1/s', 'half width of the boundary layer of the robust term', 1e-9, 1e3, 0.05, 0.03
    )
    dz: float = number(
        '1/s', 'dead-zone: Phi learns only where |xi2| is larger', 0.0, 1e3, 0.0, 0.06
    )
    band: float = number(
        '', 'alphas stay within this share of their initial values', 0.0, 1.0, 0.3, 0.3
    )
    w_max: float = number('', 'bound on the norm of the weights in Phi', 1e-9, 1e12, 1e5, 1e5)

    # threshold (16) and decision
    threshold: str = choice(
        'paper: rho = |Phi|/k2; floor: kappa |Phi|/(k2 + alpha1)', THRESHOLDS, 'paper', 'floor'
    )
    kappa: float = number('', 'factor of the threshold "floor"', 0.01, 1e3, 1.0, 1.5)
    rho_min: float = number('1/s', 'lowest threshold', 0.0, 1e3, 0.0, 0.2)
    decide_m: int = number('', 'samples over the threshold that make a decision ...', 1, 64, 2, 2)
    decide_n: int = number('', '... out of this number of latest samples', 1, 64, 2, 2)
    on_delay: float = number(
        's', 'time a decision lasts before it raises the alarm', 0.0, 3600.0, 0.0, 0.0
    )
    off_delay: float = number(
        's', 'time without decision before the condition counts as gone', 0.0, 86400.0, 0.0, 5.0
    )
    latch: bool = switch('keep the alarm until it is reset', False, True)
    level_maintenance: float = number(
        '', 'residual/threshold of "maintenance required"', 1.0, 1e6, 1.0, 1.0
    )
    level_specification: float = number(
        '', 'residual/threshold of "out of specification"', 1.0, 1e6, 1.5, 1.5
    )
    level_failure: float = number('', 'residual/threshold of "failure"', 1.0, 1e6, 2.5, 2.5)
    chatter: int = number('1/min', 'alarms per minute that count as chatter', 2, 16, 3, 3)

    # learning
    t_on: float = number('s', 'time for the filters to settle before learning', 0.0, 1e6, 0.0, 5.0)
    t_w: float = number('s', 'start of the learning of Phi', 0.0, 1e6, 0.0, 20.0)
    t_learn: float = number('s', 'earliest end of learning', 0.0, 1e7, 0.0, 60.0)
    travel_min: float = number('', 'stem travel / stroke that learning needs', 0.0, 1e6, 0.0, 0.5)
    noise_factor: float = number(
        '',
        'standard deviations of the noise, where it is largest, that '
        'Phi and threshold together keep off at least',
        0.0,
        100.0,
        5.0,
        5.0,
    )
    play: float = number(
        '', 'motion within a play of this half width is no travel', 0.0, 0.5, 0.005, 0.005
    )
    settled_stiffness: float = number(
        '', 'change of the stiffness while learning that is tolerated', 1e-6, 1.0, 0.004, 0.004
    )
    settled_friction: float = number(
        '',
        'change of the friction / (K L) while learning that is tolerated',
        1e-6,
        1.0,
        0.0018,
        0.0018,
    )
    settled_max: float = number(
        '',
        'squared distance, in standard deviations, from the valve at '
        'the start of learning that makes it start again',
        1.0,
        1e12,
        60.0,
        60.0,
    )
    gate_low: float = number(
        '', 'stem closer to the open stop: a push from the stop is ignored', 0.0, 0.5, 0.0, 0.01
    )
    gate_high: float = number(
        '', 'stem closer to the closed stop: nothing is decided or learned', 0.0, 0.5, 0.0, 0.03
    )

    # the actuator, for the force input u = m g + Ae Ps - Fvc(X, P1, P2)
    mass: float = number('kg', 'moving mass', 1e-3, 1e5, 2.0, 2.0)
    stiffness: float = number('N/m', 'spring and diaphragm constant K', 1.0, 1e9, 60892.0, 60892.0)
    stroke: float = number('m', 'travel of the stem', 1e-4, 10.0, 0.0381, 0.0381)
    preload: float = number('', 'initial compression of the spring / stroke', 0.0, 10.0, 0.0, 0.25)
    area: float = number('m2', 'effective area of the diaphragm', 1e-6, 10.0, 0.029, 0.029)
    plug_diameter: float = number('m', 'plug diameter', 0.0, 2.0, 0.05, 0.05)
    gravity: float = number('m/s2', 'gravity along the stem', -10.0, 10.0, 9.81, 9.81)
    plug_table: tuple[float, ...] = field(
        default=PLUG_TABLE,
        metadata={
            'unit': '',
            'description': 'K_m of the plug force at 0, 10, .., 90, 99, 100 % of stroke',
            'low': 0.01,
            'high': 10.0,
            'default': {'paper': PLUG_TABLE, 'monitor': PLUG_TABLE},
        },
    )

    air_to: str = choice(
        'what the air in the servomotor does to the valve; the spring does the opposite',
        ('close', 'open'),
        'close',
        'close',
    )
    flow_to: str = choice(
        'what the flow does to the plug: it pushes it to open or to close',
        ('open', 'close'),
        'open',
        'open',
    )
    ps_lag: float = number(
        's',
        'damping of the transmitter of the chamber pressure; the other signals are delayed alike',
        0.0,
        10.0,
        0.0,
        0.0,
    )

    # the valve signature
    signature: bool = switch('tell friction, spring and sensors apart; needs ps', False, True)
    own_alarm: bool = switch('alarm on changes that the approximator cannot see', False, True)
    verify: float = number(
        's',
        'time to check the force model after learning; half an hour on a real valve',
        0.0,
        1e6,
        60.0,
        60.0,
    )
    plug_gain_std: float = number(
        '',
        'how well the plug force is known: standard deviation of its gain',
        1e-9,
        1.0,
        0.03,
        0.03,
    )
    plug_shape_std: float = number('', 'and of each entry of its table', 1e-9, 1.0, 0.01, 0.01)
    material_friction: float = number(
        '', 'change of friction that asks for maintenance', 0.0, 100.0, 0.3, 0.3
    )
    material_spring: float = number(
        '', 'change of stiffness that asks for maintenance', 0.0, 1.0, 0.02, 0.02
    )
    material_supply: float = number(
        '', "loss of the chamber's top filling rate that alarms", 0.01, 0.9, 0.1, 0.1
    )
    supply_pressure: float = number(
        'Pa', 'supply pressure of the positioner, gauge', 1e4, 5e6, 600e3, 600e3
    )
    chamber_volume: float = number(
        'm3', 'dead volume of the servomotor', 0.0, 10.0, 5.5e-3, 5.5e-3
    )

    # SCADA-rate monitor
    false_alarm_days: float = number(
        'd', 'mode scada: days per false alarm', 0.01, 1e5, 30.0, 30.0
    )
    sensor_noise: float = number(
        '',
        'mode scada: standard deviation of the sensors / full scale',
        1e-6,
        0.1,
        1.414e-3,
        1.414e-3,
    )

    # input check
    signal_low: float = number(
        '', 'cv and x1 below it are refused (NAMUR NE 43: 3.6 mA)', -1.0, 0.0, -0.025, -0.025
    )
    signal_high: float = number(
        '', 'cv and x1 above it are refused (NAMUR NE 43: 21 mA)', 1.0, 2.0, 1.0625, 1.0625
    )
    p_max: float = number('Pa', 'p1 and p2 above it are refused', 1e3, 1e9, 4.25e6, 4.25e6)
    ps_max: float = number('Pa', 'ps above it is refused', 1e3, 1e8, 1e6, 1e6)
    gap_reset: float = number(
        's', 'a longer gap restarts the filters; what is learned stays', 1e-3, 1e6, 2.0, 2.0
    )
    hold: float = number('s', 'no decision for this time after such a restart', 0.0, 1e4, 0.0, 1.0)
    clock_jump: float = number(
        's', 'stamps further back than this may be a clock that was set back', 1e-3, 1e9, 1.0, 1.0
    )
    clock_jump_samples: int = number('', 'samples in order that confirm it', 2, 10000, 10, 10)

    def __post_init__(self) -> None:
        """Refuse wrong values."""
        problems = self.problems()
        if problems:
            raise SettingsError(problems)
        for item in fields(self):  # 5 is a fine value of a float setting
            if item.type is float:
                object.__setattr__(self, item.name, float(getattr(self, item.name)))
        object.__setattr__(self, 'plug_table', tuple(float(v) for v in self.plug_table))

    @classmethod
    def for_mode(cls, mode: str, **changes: Any) -> Self:
        """
        Return the settings of a mode.

        :param mode: 'paper', 'monitor' or 'scada'.
        :param changes: settings that differ from the mode's defaults.
        :return: the settings.
        :raises SettingsError: listing all unknown names and wrong values.
        """
        return cls.from_mapping({'mode': mode, **changes})

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Self:
        """
        Return settings from names and values, as a parameter file gives them.

        :param values: settings by name; the rest get the defaults of `values['mode']`.
        :return: the settings.
        :raises SettingsError: listing all unknown names and wrong values.
        """
        known = {item.name: item for item in fields(cls)}
        problems = [f'{name}: no such setting' for name in values if name not in known]
        mode = values.get('mode', 'monitor')
        if mode not in MODES:
            raise SettingsError([*problems, wrong_choice('mode', mode, MODES)])
        merged = {name: _default(item, mode) for name, item in known.items()}
        merged.update({name: value for name, value in values.items() if name in known})
        try:
            settings = cls(**merged)
        except SettingsError as error:
            problems += error.problems
        if problems:
            raise SettingsError(problems)
        return settings

    def replace(self, **changes: Any) -> Self:
        """
        Return these settings with some changed.

        :param changes: settings by name.
        :return: the new settings.
        """
        return replace(self, **changes)

    def problems(self) -> list[str]:
        """
        List every error of the values.

        :return: one sentence per error; empty where all is well.
        """
        texts = (problem_of(item, getattr(self, item.name)) for item in fields(self))
        return list(filter(None, texts)) or _contradictions(self)

    def to_dict(self) -> dict[str, Any]:
        """
        Return the settings by name, as `from_mapping` takes them.

        :return: plain numbers, strings and lists.
        """
        values = asdict(self)
        values['plug_table'] = list(self.plug_table)
        return values

    @classmethod
    def describe(cls, mode: str = 'monitor') -> list[dict[str, Any]]:
        """
        Describe every setting for a parameter declaration or a help page.

        :param mode: the mode whose defaults are given.
        :return: per setting `name`, `type` (str, bool, int, float or tuple), `default`, `unit`,
            `description` and `low`, `high` or `choices` where they apply.
        """
        return [
            {
                **item.metadata,
                'name': item.name,
                'type': type(item.default),
                'default': _default(item, mode),
            }
            for item in fields(cls)
        ]

    def record(self) -> NDArray[Any]:
        """
        Return the settings for the compiled steps.

        :return: structured array of length 1; choices are their index, `dt` is 1/sample_rate.
        """
        array = np.zeros(1, SETTINGS_DTYPE)
        for item in fields(self):
            value = getattr(self, item.name)
            choices = item.metadata.get('choices')
            array[item.name] = choices.index(value) if choices else value
        array['dt'] = 1.0 / self.sample_rate
        array['preload'] = self.spring_origin
        array['weight'] = self.mass * self.gravity / (self.stiffness * self.stroke)
        array['area_per_force'] = self.signed_area / (self.stiffness * self.stroke)
        array['plug_per_force'] = self.signed_plug_area / (self.stiffness * self.stroke)
        return array

    @property
    def spring_origin(self) -> float:
        """
        Return where the spring is relaxed, so that its force is K L (X + origin), + to open.

        :return: preload where the spring opens, -(1 + preload) where it closes [1].
        """
        return self.preload if self.air_to == 'close' else -1.0 - self.preload

    @property
    def signed_area(self) -> float:
        """
        Return the area of the diaphragm, negative where the air opens.

        :return: [m2].
        """
        return self.area if self.air_to == 'close' else -self.area

    @property
    def signed_plug_area(self) -> float:
        """
        Return the area of the plug, negative where the flow closes.

        :return: [m2].
        """
        area = math.pi * self.plug_diameter**2 / 4.0
        return area if self.flow_to == 'open' else -area


def _dtype() -> np.dtype:
    kinds: dict[type, Any] = {str: 'i8', bool: '?', int: 'i8', float: 'f8'}
    columns = [
        (item.name, 'f8', (len(PLUG_TABLE),))
        if item.name == 'plug_table'
        else (item.name, kinds[type(item.default)])
        for item in fields(Settings)
    ]
    derived = [(name, 'f8') for name in ('dt', 'weight', 'area_per_force', 'plug_per_force')]
    return np.dtype((np.record, np.dtype([*columns, *derived], align=True)))


def _default(item: Field, mode: str) -> Any:
    defaults = item.metadata['default']
    return SCADA.get(item.name, defaults['monitor']) if mode == 'scada' else defaults[mode]


def _contradictions(s: Settings) -> list[str]:
    checks = [
        (s.decide_m <= s.decide_n, 'decide_m is larger than decide_n: no decision is possible'),
        (
            s.level_maintenance <= s.level_specification <= s.level_failure,
            'the levels must not fall: level_maintenance <= level_specification <= level_failure',
        ),
    ]
    if s.mode == 'monitor':
        checks += [
            (s.dz >= s.delta, 'dz is below delta: Phi would grow inside the boundary layer'),
            (
                s.rho_min > s.dz,
                'rho_min is not larger than dz: the threshold could end inside the '
                'dead-zone and alarm for ever',
            ),
            (s.t_on <= s.t_w <= s.t_learn, 't_on <= t_w <= t_learn does not hold'),
            (
                s.consistent or s.velocity == 'super_twisting',
                'consistent is off: the filter lag '
                'would show as a fault; switch it on or choose velocity super_twisting',
            ),
        ]
    return [text for holds, text in checks if not holds]


SETTINGS_DTYPE = _dtype()
