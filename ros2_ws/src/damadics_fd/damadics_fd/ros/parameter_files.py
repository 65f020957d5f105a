# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Parameter files on a node's command line: whether they are there, whether they say anything."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import yaml

OPTION = '--params-file'
SECTION = 'ros__parameters'
SHOWN = 5  # sections that a message names


def files_of(words: Sequence[str]) -> list[Path]:
    """
    List the parameter files of a command line.

    :param words: arguments of ROS 2.
    :return: the files in order.

    >>> files_of(['--ros-args', '--params-file', 'a.yaml', '-p', 'k2:=3.0'])
    [PosixPath('a.yaml')]
    """
    pairs = zip(words, words[1:], strict=False)
    return [Path(value) for option, value in pairs if option == OPTION]


def missing_file(words: Sequence[str]) -> str:
    """
    Tell which parameter file cannot be read; rclpy says so in twenty lines.

    :param words: arguments of ROS 2.
    :return: one sentence, '' where all are there.
    """
    for file in files_of(words):
        try:
            with file.open('rb'):
                pass
        except OSError as problem:
            return f'{OPTION} {file}: {problem.strerror}'
    return ''


def says_nothing(file: Path, node: str) -> str:
    """
    Tell why a parameter file sets nothing for a node.

    :param file: the file.
    :param node: full name of the node, such as /lv101/estimator.
    :return: one sentence, '' where it sets something or rclpy itself refuses it.
    """
    try:
        content = yaml.safe_load(file.read_text(encoding='utf-8'))
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return f'{file} sets nothing for {node}: it is no parameter file'
    sections = dict(_sections(content, ''))
    if not sections:
        return f'{file} sets nothing for {node}: it has no section with {SECTION}'
    if any(count and _pattern(name).fullmatch(node) for name, count in sections.items()):
        return ''
    names = ', '.join(list(sections)[:SHOWN]) + (', ...' if len(sections) > SHOWN else '')
    return f'{file} sets nothing for {node}: its sections are {names}'


def _sections(content: object, name: str) -> Iterator[tuple[str, int]]:
    """Find the sections: name of the node, possibly with wildcards, and number of parameters."""
    if not isinstance(content, dict):
        return
    for key, below in content.items():
        if key == SECTION:
            yield name, len(below) if isinstance(below, dict) else 0
        else:
            yield from _sections(below, f'{name}/{str(key).strip("/")}')


def _pattern(name: str) -> re.Pattern[str]:
    parts = {'**': r'(?:/[^/]+)*', '*': '/[^/]+'}
    return re.compile(
        ''.join(parts.get(part, f'/{re.escape(part)}') for part in name.split('/') if part)
    )
