# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""All settings of a valve's monitor in one record."""

from collections.abc import Mapping
from dataclasses import Field, asdict, dataclass, fields, replace
from typing import Any, Self, TypedDict

from damadics_fd.core.field import Given, Section, SettingsError, Value, wrong_choice
from damadics_fd.core.modes import MODES
from damadics_fd.core.record import Plain
from damadics_fd.core.settings.approximation import Approximation
from damadics_fd.core.settings.control_room import LEAST_LEARNING, WIDE_PLAY, ControlRoom
from damadics_fd.core.settings.deciding import Deciding
from damadics_fd.core.settings.explaining import Explaining
from damadics_fd.core.settings.learning_time import LearningTime
from damadics_fd.core.settings.operation import Operation
from damadics_fd.core.valve.parameters import Valve

VALVE = tuple(item.name for item in fields(Valve))


class Description(TypedDict, total=False):
    """Describe one setting; `low`, `high` and `choices` where they apply."""

    name: str
    type: type[Value]
    default: Value
    unit: str
    description: str
    low: float
    high: float
    choices: tuple[str, ...]
    modes: tuple[str, ...]  # that read it
    describes: str  # 'valve' or 'mode'


@dataclass(frozen=True)
class Settings(Valve, ControlRoom, Explaining, LearningTime, Deciding, Approximation, Operation):
    """
    Hold every number that estimator and detector depend on.

    What describes the valve is accepted in every mode; what tunes a mode is refused where another
    mode is chosen that does not read it. `describe()` lists all settings for declarations of
    parameters, with unit, range and description.

    :raises SettingsError: listing every value that is missing, of a wrong type, out of its
        range, not read by the mode, or in contradiction to another.

    >>> Settings.for_mode('paper').k2
    400.0
    >>> Settings(k1=-1.0, kappa=0.0)
    Traceback (most recent call last):
    damadics_fd.core.field.SettingsError: k1 = -1.0 1/s is outside 0.001..1e+06; ...
    """

    @classmethod
    def for_mode(cls, mode: str, **changes: Given) -> Self:
        """
        Return the settings of a mode.

        :param mode: 'paper', 'monitor' or 'scada'.
        :param changes: settings that differ from the mode's defaults.
        :return: the settings.
        :raises SettingsError: listing all unknown names and wrong values.
        """
        return cls.from_mapping({'mode': mode, **changes})

    @classmethod
    def from_mapping(cls, values: Mapping[str, Given]) -> Self:
        """
        Return settings from names and values, as a parameter file gives them.

        :param values: settings by name; the rest get the defaults of `values['mode']`.
        :return: the settings.
        :raises SettingsError: listing all unknown names and wrong values.
        """
        known = {item.name: item for item in fields(cls)}
        problems = [f'{name}: no such setting' for name in values if name not in known]
        mode = values.get('mode', 'monitor')
        if not isinstance(mode, str) or mode not in MODES:
            raise SettingsError([*problems, wrong_choice('mode', mode, MODES)])
        merged: dict[str, Any] = {name: _default(item, mode) for name, item in known.items()}
        given = {name: value for name, value in values.items() if name in known}
        problems += [
            unread(name, mode)
            for name, value in given.items()
            if unread(name, mode) and value != merged[name]
        ]
        merged |= given
        try:
            settings = cls(**merged)
        except SettingsError as error:
            problems += [problem for problem in error.problems if problem not in problems]
        if problems:
            raise SettingsError(problems)
        return settings

    def replace(self, **changes: Given) -> Self:
        """
        Return these settings with some changed.

        :param changes: settings by name.
        :return: the new settings.
        """
        values: dict[str, Any] = dict(changes)
        return replace(self, **values)

    def valve(self) -> Valve:
        """
        Return what these settings say of the valve.

        :return: the valve alone.
        """
        return Valve(**{name: getattr(self, name) for name in VALVE})

    def problems(self) -> list[str]:
        """
        List every error of the values.

        :return: one sentence per error; empty where all is well.
        """
        return Section.problems(self) or _unread(self) or _contradictions(self)

    def to_dict(self) -> dict[str, Plain]:
        """
        Return the settings by name, as `from_mapping` takes them.

        :return: plain numbers, strings and lists.
        """
        values: dict[str, Plain] = asdict(self)
        values['plug_table'] = list(self.plug_table)
        return values

    @classmethod
    def describe(cls, mode: str = 'monitor') -> list[Description]:
        """
        Describe every setting for a parameter declaration or a help page.

        :param mode: the mode whose defaults are given.
        :return: all settings, in order; those that the mode does not read too.
        """
        return [_described(item, mode) for item in fields(cls)]


def unread(name: str, mode: str) -> str:
    """
    Say that a mode does not read a setting.

    :param name: of the setting.
    :param mode: the mode.
    :return: one sentence; '' where it reads it or where there is no such setting.
    """
    item = Settings.__dataclass_fields__.get(name)
    if item is None or mode in item.metadata['modes']:
        return ''
    readers = ', '.join(item.metadata['modes'])
    return f'{name}: mode {mode} does not read it (read in: {readers}): leave it out'


def _described(item: 'Field[Value]', mode: str) -> Description:
    meta = item.metadata
    row = Description(
        name=item.name,
        type=type(meta['default']['monitor']),
        default=_default(item, mode),
        unit=meta['unit'],
        description=meta['description'],
        modes=meta['modes'],
        describes='valve' if item.name in VALVE else 'mode',
    )
    if 'choices' in meta:
        row['choices'] = meta['choices']
    if 'low' in meta:
        row['low'], row['high'] = meta['low'], meta['high']
    return row


def _default(item: 'Field[Value]', mode: str) -> Value:
    default: Value = item.metadata['default'][mode]
    return default


def _unread(s: Settings) -> list[str]:
    """List what was changed although the mode does not read it."""
    return [
        unread(item.name, s.mode)
        for item in fields(s)
        if s.mode not in item.metadata['modes']
        and getattr(s, item.name) not in item.metadata['default'].values()
    ]


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
    if s.mode == 'scada':
        checks += [
            (
                s.t_learn > s.t_w + LEAST_LEARNING,
                f't_learn is not more than {LEAST_LEARNING:g} s after t_w: mode scada learns that '
                'long',
            ),
            (
                s.stem_play < WIDE_PLAY,
                f'stem_play is not below {WIDE_PLAY:g}: the friction test compares with a play of '
                'that size',
            ),
        ]
    return [text for holds, text in checks if not holds]
