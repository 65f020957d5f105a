# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Declare a node's parameters so that all mistakes in them are reported together."""

from collections.abc import Iterable, Mapping
from typing import TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter

from damadics_fd.core.field import Given
from damadics_fd.core.modes import MODES
from damadics_fd.core.record import Plain, Saved
from damadics_fd.core.settings import Settings, SettingsError, unread
from damadics_fd.ros.arguments import suggestion
from damadics_fd.ros.spin import UsageError

T = TypeVar('T')
DEFAULT_MODE = 'monitor'
OF_EVERY_NODE = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')


class Parameters:
    """
    Declare parameters, collect what is wrong with them and refuse them together.

    :param node: the node that has the parameters.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._problems: list[str] = []
        self._names: list[str] = []

    def declare(
        self,
        name: str,
        default: T,
        description: str,
        *,
        limits: tuple[float, float] | None = None,
        allowed: Iterable[str] = (),
        live: bool = False,
    ) -> T:
        """
        Declare one parameter.

        :param name: name of the parameter.
        :param default: value where none is given; its type is the parameter's type.
        :param description: one line for people, with the unit.
        :param limits: least and greatest value.
        :param allowed: the values of a text parameter.
        :param live: it may be changed while the node runs; otherwise it is read-only.
        :return: the value; the default where the given one is refused.
        """
        self._names.append(name)
        allowed = tuple(allowed)
        descriptor = ParameterDescriptor(description=description, read_only=not live)
        if allowed:
            descriptor.additional_constraints = 'one of: ' + ', '.join(allowed)
        if limits and isinstance(default, float):
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(limits[0]), to_value=float(limits[1]))
            ]
        elif limits:
            descriptor.integer_range = [
                IntegerRange(from_value=int(limits[0]), to_value=int(limits[1]))
            ]
        try:
            value = self._node.declare_parameter(name, default, descriptor).value
        except InvalidParameterTypeException:
            given = self._given()[name].value
            kind = (
                'a number with a decimal point'
                if isinstance(default, float)
                else (f'of type {type(default).__name__}')
            )
            self._refuse(name, f'{given!r} is not {kind}', description)
            return default
        except InvalidParameterValueException:
            low, high = limits or ('?', '?')
            given = self._given()[name].value
            self._refuse(name, f'{given!r} is not within {low} .. {high}', description)
            return default
        if allowed and value not in allowed:
            self._refuse(name, f'{value!r} is not one of {", ".join(allowed)}', description)
            return default
        return value

    def check(self, *more: str) -> None:
        """
        Refuse the parameters if anything is wrong with them; call it after the last declaration.

        :param more: further mistakes that the node has found.
        :raises UsageError: listing every mistake, a line each.
        """
        for name in self._given():
            if name in self._names or name.startswith(OF_EVERY_NODE):
                continue
            hint = suggestion(name, self._names)
            said = f'{name}: there is no such parameter'
            self._problems.append(f'{said}: {hint}' if hint else said)
        problems = [*self._problems, *more]
        if problems:
            name = self._node.get_name()
            raise UsageError('\n  '.join([f'{name} does not start, its parameters:', *problems]))

    def pass_over(self, names: Iterable[str]) -> list[str]:
        """
        Let parameters that other nodes read stand in a file for all nodes.

        :param names: of parameters.
        :return: those that are given and that this node has not declared.
        """
        given = [
            name for name in sorted(names) if name in self._given() and name not in self._names
        ]
        self._names += given
        return given

    def take(self, group: str) -> Saved:
        """
        Take the parameters of a group as they are given; who uses them checks them.

        :param group: what stands before the dot of their names.
        :return: values by name, without the group; lists as text.
        """
        values: Saved = {}
        for name, parameter in self._given().items():
            if name.startswith(f'{group}.'):
                self._names.append(name)
                value = parameter.value
                single = value if isinstance(value, (int, float, str)) else f'{value}'
                values[name.removeprefix(f'{group}.')] = single
        return values

    def refuse(self, name: str, text: str) -> None:
        """
        Refuse a parameter that is not declared, where it is given.

        :param name: name of the parameter.
        :param text: the whole sentence.
        """
        self._names.append(name)
        if name in self._given():
            self._problems.append(text)

    def _refuse(self, name: str, cause: str, description: str) -> None:
        self._problems.append(f'{name}: {cause} ({description})')

    def _given(self) -> Mapping[str, Parameter]:
        # rclpy has no public view of the overrides of parameters that are not declared
        return self._node._parameter_overrides


def declare_settings(parameters: Parameters) -> Settings:
    """
    Declare every setting that the mode reads as a parameter and read them.

    :param parameters: of the node, with its other parameters declared.
    :return: the settings.
    :raises UsageError: listing every mistake in the node's parameters.
    """
    mode = parameters.declare('mode', DEFAULT_MODE, 'how the approximator is run', allowed=MODES)
    values: dict[str, Given] = {}
    for entry in Settings.describe(mode):
        if entry['name'] == 'mode':
            continue
        if mode not in entry['modes']:
            parameters.refuse(entry['name'], unread(entry['name'], mode))
            continue
        unit = f' [{entry["unit"]}]' if entry['unit'] else ''
        default = entry['default']
        plain: Plain = [*default] if isinstance(default, tuple) else default
        values[entry['name']] = parameters.declare(
            entry['name'],
            plain,
            entry['description'] + unit,
            limits=(entry['low'], entry['high']) if type(default) in (int, float) else None,
            allowed=entry.get('choices', ()),
        )
    problems: list[str] = []
    settings = Settings.for_mode(mode)
    try:
        settings = Settings.from_mapping({'mode': mode, **values})
    except SettingsError as error:
        problems = error.problems
    parameters.check(*problems)
    return settings
