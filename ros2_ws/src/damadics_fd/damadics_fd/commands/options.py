# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Options that several commands have, described and read once."""

import argparse
from collections.abc import Sequence

import yaml

from damadics_fd.core.record import Saved
from damadics_fd.core.settings import Settings, SettingsError
from damadics_fd.ros.arguments import suggestion


def add_settings(parser: argparse.ArgumentParser, meaning: str) -> None:
    """
    Add `--set`.

    :param parser: of the command.
    :param meaning: what the settings are for.
    """
    parser.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='NAME=VALUE',
        help=f'{meaning}; may be repeated',
    )


def add_sources(parser: argparse.ArgumentParser) -> None:
    """
    Add `--topic` and `--map`: where the signals of a recording are.

    :param parser: of the command.
    """
    parser.add_argument('--topic', help='topic of the measurements; by default all of them')
    parser.add_argument(
        '--map',
        action='append',
        default=[],
        metavar='SIGNAL=SOURCE',
        help='where a signal is: /topic.field in a bag, a column in a table; then [UNIT], *FACTOR,'
        ' +OFFSET, invert as needed: x1=POS[%%] invert',
    )


def settings_in(texts: Sequence[str]) -> Saved:
    """
    Read the words of `--set`.

    :param texts: NAME=VALUE each, the value as in YAML.
    :return: values by name, not checked yet.
    :raises SettingsError: listing every one that cannot be read.
    """
    values: Saved = {}
    problems = []
    for text in texts:
        name, equals, value = text.partition('=')
        if not equals:
            problems.append(f'--set {text}: write NAME=VALUE')
            continue
        try:
            values[name] = yaml.safe_load(value)
        except (yaml.YAMLError, ValueError, RecursionError):
            problems.append(f'--set {text}: the value cannot be read')
    if problems:
        raise SettingsError(problems)
    return values


def with_suggestions(error: SettingsError) -> str:
    """
    Say what is wrong with settings, and for unknown names which one may be meant.

    :param error: of the settings.
    :return: its text, one line.

    >>> with_suggestions(SettingsError(['tlearn: no such setting']))
    'tlearn: no such setting: do you mean t_learn?'
    """
    known = [str(entry['name']) for entry in Settings.describe()]
    problems = []
    for problem in error.problems:
        name, unknown, _ = problem.partition(': no such setting')
        hint = suggestion(name, known) if unknown else ''
        problems.append(f'{problem}: {hint}' if hint else problem)
    return str(SettingsError(problems))
