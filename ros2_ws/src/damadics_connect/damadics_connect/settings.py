# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read a configuration file; every mistake in it is told at once, and no secret is shown."""

import math
import os
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path

import yaml
from damadics_fd.store.access import Access, AccessError, read_access
from damadics_fd.store.yaml_text import read_yaml

LARGEST = 20_000_000  # bytes of a configuration: thousands of valves
Value = str | float | bool | None


class ConfigError(ValueError):
    """The configuration is wrong; the message has a line for every mistake."""


class Secret:
    """A password or token; every way to print it shows three dots."""

    def __init__(self, value: str = '') -> None:
        self._value = value

    def reveal(self) -> str:
        """Return the secret itself, to be handed to a library and nowhere else."""
        return self._value

    def __bool__(self) -> bool:
        """Whether there is one."""
        return bool(self._value)

    def __repr__(self) -> str:
        """Show that there is one, not which."""
        return '...' if self._value else "''"

    __str__ = __repr__


class Section:
    """
    One mapping of a configuration, read entry by entry.

    :param content: the mapping.
    :param where: its place in the file, for messages.
    :param problems: takes one line for each mistake.
    :param folder: of the file: relative paths begin here.
    """

    def __init__(
        self, content: object, where: str, problems: list[str], folder: Path = Path()
    ) -> None:
        self.where = where
        self.problems = problems
        self.folder = folder
        self._asked: set[str] = set()
        if content is not None and not isinstance(content, dict):
            problems.append(f'{where or "file"}: write entries "name: value"')
            content = {}
        self._content: Mapping[str, object] = {str(k): v for k, v in (content or {}).items()}

    def __contains__(self, name: str) -> bool:
        """Whether an entry is there."""
        return self._content.get(name) is not None

    def text(self, name: str, default: str = '', *, choices: Iterable[str] = ()) -> str:
        """
        Read a text.

        :param name: of the entry.
        :param default: where it is missing.
        :param choices: what it may be; () for any.
        :return: the text.
        """
        value = self._take(name)
        if value is None:
            return default
        if isinstance(value, dict | list | bool):
            self.refuse(name, 'is not a text')
            return default
        allowed = tuple(choices)
        if allowed and str(value) not in allowed:
            self.refuse(name, f'is not one of {", ".join(allowed)}')
            return default
        return str(value)

    def needed(self, name: str, example: str) -> str:
        """Read a text that has no default; `example` goes into the message where it is missing."""
        value = self.text(name)
        if not value and not isinstance(self._content.get(name), dict | list):
            self.problems.append(f'{self._at(name)} is missing, such as {name}: {example}')
        return value

    def number(self, name: str, default: float, low: float, high: float) -> float:
        """Read a number within low .. high."""
        value = self._take(name)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(name, f'is not a number from {low:g} to {high:g}')
            return default
        try:
            number = float(value)
        except OverflowError:
            number = math.inf if value > 0 else -math.inf
        if not low <= number <= high:
            self.refuse(name, f'{number:g} is not within {low:g} .. {high:g}')
            return default
        return number

    def flag(self, name: str, default: bool = False) -> bool:
        """Read true or false."""
        value = self._take(name)
        if value is None:
            return default
        if not isinstance(value, bool):
            self.refuse(name, 'is neither true nor false')
            return default
        return value

    def path(self, name: str, *, must_exist: bool = True, secret: bool = False) -> Path | None:
        """
        Read a path, relative to the configuration's folder.

        :param name: of the entry.
        :param must_exist: a file or folder has to be there.
        :param secret: of a file with a secret in it: what stands here may be the secret itself.
        :return: None where the entry is missing.
        """
        value = self.text(name)
        if not value:
            return None
        shown_as = f'this file, in {self.folder},' if secret else ''
        try:
            path = self.folder / Path(value).expanduser()
            there = path.exists()
        except (OSError, ValueError, RuntimeError) as problem:
            why = getattr(problem, 'strerror', None) or 'is no path'
            self.problems.append(f'{self._at(name)}: {shown_as or "this"}: {why}')
            return None
        if must_exist and not there:
            self.problems.append(f'{self._at(name)}: {shown_as or path} does not exist')
        return path

    def texts(self, name: str) -> list[str]:
        """Read a list of texts; one text alone is a list of one."""
        value = self._take(name)
        if value is None:
            return []
        values = value if isinstance(value, list) else [value]
        if any(isinstance(each, dict | list) for each in values):
            self.refuse(name, 'is not a list of texts')
            return []
        return [str(each) for each in values]

    def section(self, name: str) -> 'Section':
        """Read a mapping; an empty one where it is missing."""
        return self._below(self._take(name), name)

    def sections(self, name: str) -> dict[str, 'Section']:
        """Read a mapping of mappings."""
        value = self._take(name)
        if value is None:
            return {}
        if not isinstance(value, dict):
            self.refuse(name, 'is not a mapping of names')
            return {}
        return {str(key): self._below(each, f'{name}.{key}') for key, each in value.items()}

    def listed(self, name: str) -> list['Section']:
        """Read a list of mappings."""
        value = self._take(name)
        if value is None:
            return []
        if not isinstance(value, list):
            self.refuse(name, 'is not a list')
            return []
        return [self._below(each, f'{name}[{n}]') for n, each in enumerate(value, 1)]

    def mapping(self, name: str) -> dict[str, object]:
        """Read a mapping as it is."""
        value = self._take(name)
        if value is not None and not isinstance(value, dict):
            self.refuse(name, 'is not a mapping')
            return {}
        return {str(key): each for key, each in (value or {}).items()}

    def secret(self, name: str) -> Secret:
        """
        Read a secret from the file `NAME_file` or the variable `NAME_env` of the environment.

        Written into the configuration it would be copied, mailed and kept with it.
        """
        if self._take(name) is not None:
            self.refuse(name, f'stands in the file: give {name}_file or {name}_env instead')
        file = self.path(f'{name}_file', secret=True)
        variable = self.text(f'{name}_env')
        if file is not None and file.exists():
            where = f'{self._at(name)}_file: {file}'
            try:
                secret = Secret(file.read_text().strip())
            except OSError as problem:
                self.problems.append(f'{where} cannot be read: {problem.strerror}')
                return Secret()
            except UnicodeDecodeError:
                self.problems.append(f'{where} is not a text file')
                return Secret()
            if not secret:
                self.problems.append(f'{where} is empty')
            return secret
        if variable and not os.environ.get(variable):
            self.problems.append(
                f'{self._at(name)}_env: there is no such variable, or it is empty'
            )
        return Secret(os.environ.get(variable, '') if variable else '')

    def tokens(self) -> Access:
        """Read `token_file`: who may enter; open to everybody only where the entry is missing."""
        path = self.path('token_file', secret=True)
        if path is None or not path.exists():
            return Access()
        try:
            return read_access(path)
        except AccessError as problem:
            self.problems.append(f'{self._at("token_file")}: {problem}')
            return Access()

    def refuse(self, name: str, why: str) -> None:
        """Note a mistake in an entry; the value itself is not shown."""
        self.problems.append(f'{self._at(name)} {why}')

    def done(self) -> None:
        """Note the entries that nobody has asked for; call it after the last entry was read."""
        for name in self._content:
            if name not in self._asked:
                near = get_close_matches(name, self._asked, 1)
                hint = f': do you mean {near[0]}?' if near else ''
                known = '' if near else f'; there are {", ".join(sorted(self._asked))}'
                self.problems.append(f'{self._at(name)}: there is no such entry{hint}{known}')

    def _take(self, name: str) -> object:
        self._asked.add(name)
        return self._content.get(name)

    def _at(self, name: str) -> str:
        return f'{self.where}.{name}' if self.where else name

    def _below(self, content: object, name: str) -> 'Section':
        return Section(content, self._at(name), self.problems, self.folder)


def read_config(path: Path) -> Section:
    """
    Open a configuration.

    :param path: a YAML file.
    :return: its entries.
    :raises ConfigError: where it cannot be read.
    """
    try:
        if path.stat().st_size > LARGEST:
            raise ConfigError(f'{path}: larger than {LARGEST} bytes: this is no configuration')
        content = read_yaml(path.read_text('utf-8-sig'))
    except OSError as problem:
        raise ConfigError(f'{path}: {problem.strerror}') from problem
    except UnicodeDecodeError as problem:
        raise ConfigError(f'{path}: not a text file') from problem
    except yaml.YAMLError as problem:
        mark = getattr(problem, 'problem_mark', None)
        line = f', line {mark.line + 1}' if mark else ''
        what = getattr(problem, 'problem', None) or getattr(problem, 'reason', '')
        raise ConfigError(f'{path}{line}: not valid YAML: {what}') from problem
    return Section(content or {}, '', [], path.resolve().parent)


def check(section: Section, path: Path) -> None:
    """
    Refuse a configuration with mistakes.

    :param section: the whole file, after all entries were read.
    :param path: the file, for the message.
    :raises ConfigError: with a line for every mistake.
    """
    section.done()
    if section.problems:
        raise ConfigError('\n  '.join([f'{path}:', *section.problems]))
