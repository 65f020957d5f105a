# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The parameter file of a valve, `valve.param.yaml`, as plain data: read and written in one way.

Nodes, replay, fleet, page and plant take the same file; it says only what differs from the
defaults of its mode.

>>> document = ValveDocument(Settings.for_mode('monitor', mass=3.0), 'LV-101')
>>> document.plain()
{'/**': {'ros__parameters': {'mode': 'monitor', 'actuator': 'LV-101', 'mass': 3.0}}}
>>> ValveDocument.read(document.plain()) == document
True
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

from damadics_fd.core.field import Given, SettingsError
from damadics_fd.core.record import Plain, Saved
from damadics_fd.core.settings.settings import Settings

EVERY_NODE, ESTIMATOR, PARAMETERS = '/**', '/**/estimator', 'ros__parameters'
COMMISSION, PLANT = '/**/commission', '/**/plant'
"""Sections of what is no parameter of a monitor: the verdict, and a model of the valve."""


@dataclass(frozen=True)
class ValveDocument:
    """Hold what a parameter file says of a valve."""

    settings: Settings
    actuator: str = ''  # tag; '' where the file has none
    reference: str = ''  # path of what was learned, for the estimator; '' for none

    def plain(self) -> Saved:
        """
        Return the file's content.

        :return: parameters by node, as ROS 2 reads them.
        """
        every: Saved = {'mode': self.settings.mode}
        if self.actuator:
            every['actuator'] = self.actuator
        content: Saved = {EVERY_NODE: {PARAMETERS: every | differing(self.settings)}}
        if self.reference:
            content[ESTIMATOR] = {PARAMETERS: {'reference': self.reference}}
        return content

    @classmethod
    def read(cls, content: Plain, mode: str = '') -> Self:
        """
        Read a file's content.

        :param content: what its YAML holds.
        :param mode: takes the place of the file's own mode.
        :return: the document; parameters that are no settings of the core are left to the nodes.
        :raises SettingsError: where it holds no parameters, or wrong ones; all at once.
        """
        given = parameters_in(content)
        known = {row['name'] for row in Settings.describe()}
        values: dict[str, Given] = {name: value for name, value in given.items() if name in known}
        if mode:
            values['mode'] = mode
        return cls(
            Settings.from_mapping(values),
            _text(given.get('actuator')),
            _text(given.get('reference')),
        )


def differing(settings: Settings) -> Saved:
    """
    Return the settings that differ from the defaults of their mode.

    :param settings: all settings.
    :return: plain values by name, without the mode.
    """
    usual = Settings.for_mode(settings.mode).to_dict()
    return {name: value for name, value in settings.to_dict().items() if value != usual[name]}


def parameters_in(content: Plain) -> Saved:
    """
    Return all parameters in the content of a parameter file, whichever monitor node they are for.

    :param content: what the file's YAML holds.
    :return: values by name; verdict and model of the valve are left out.
    :raises SettingsError: where there are none.
    """
    merged: Saved = {}
    for parameters in _nodes(content):
        merged |= parameters
    if not merged:
        raise SettingsError(['there are no ros__parameters of estimator or detector in it'])
    return merged


def _nodes(content: Plain) -> Iterator[Saved]:
    for name in content if isinstance(content, dict) else ():
        if name not in (COMMISSION, PLANT):
            yield section(content, name)


def section(content: Plain, name: str) -> Saved:
    """
    Return one section of a parameter file.

    :param content: what the file's YAML holds.
    :param name: of the node, such as COMMISSION.
    :return: its parameters; {} where there is no such section.

    >>> section({'/**/commission': {'ros__parameters': {'verdict': 'ok'}}}, COMMISSION)
    {'verdict': 'ok'}
    """
    node = content.get(name) if isinstance(content, dict) else None
    parameters = node.get(PARAMETERS) if isinstance(node, dict) else None
    return parameters if isinstance(parameters, dict) else {}


def _text(value: Plain) -> str:
    return '' if value is None else str(value)
