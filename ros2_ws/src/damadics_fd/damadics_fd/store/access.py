# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who may see and who may act: tokens by role, for the page and the connectors."""

import hmac
import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from damadics_fd.core.text import NAME, plain

LEAST = 16  # characters of a token
TOKEN = re.compile(r'[A-Za-z0-9._~-]+')  # survives an address, a cookie and a header unchanged
LARGEST = 100_000  # bytes of a token file
HOW_TO = 'openssl rand -hex 16 makes a good one'


class AccessError(ValueError):
    """The tokens are wrong; the message has a line for each mistake. It shows no token."""


class Role(StrEnum):
    """What a person or a program may do."""

    VIEWER = 'viewer'  # see
    OPERATOR = 'operator'  # see, acknowledge, reset, shelve, relearn


@dataclass(frozen=True)
class Grant:
    """What one token allows."""

    role: Role
    token: str
    name: str = ''  # of who has it, '' if the file does not say

    def __repr__(self) -> str:
        """Leave the token out: this may get into a log."""
        return f'Grant({self.role}, {self.name!r})'


class Access:
    """
    The tokens that are accepted.

    :param grants: one for each token; none: nobody needs one.
    """

    def __init__(self, grants: Iterable[Grant] = ()) -> None:
        self.grants = tuple(grants)

    @property
    def open(self) -> bool:
        """Whether no token is asked for."""
        return not self.grants

    def of(self, token: str) -> Grant | None:
        """
        Find what a token allows, in a time that does not tell how much of it was right.

        :param token: as it was shown.
        :return: its grant; None for a wrong one.
        """
        found = None
        for grant in self.grants:
            same = hmac.compare_digest(
                token.encode('utf-8', 'surrogatepass'), grant.token.encode()
            )
            found = grant if same else found
        return found

    def may_operate(self, token: str) -> bool:
        """
        Tell whether a token lets its owner act.

        :param token: as it was shown, '' for none.
        :return: True for an operator, and for everybody where no token is asked for.
        """
        grant = self.of(token)
        return self.open or (grant is not None and grant.role is Role.OPERATOR)


def read_access(path: Path) -> Access:
    """
    Read a file of tokens.

    One line each: `operator TOKEN`, `viewer TOKEN`, with the owner's name after it if wanted. A
    line with a token alone is an operator's. Empty lines and lines that begin with # are skipped.

    :param path: the file.
    :return: the tokens.
    :raises AccessError: naming every mistake by its line.
    """
    try:
        with path.open('rb') as stream:
            content = stream.read(LARGEST + 1)
        lines = content.decode().splitlines()
    except OSError as problem:
        raise AccessError(f'{path}: {problem.strerror}') from problem
    except UnicodeDecodeError as problem:
        raise AccessError(f'{path}: not a text file') from problem
    if len(content) > LARGEST:
        raise AccessError(f'{path}: larger than {LARGEST} bytes: this is no file of tokens')
    return parse_access(lines, str(path))


def parse_access(lines: Iterable[str], source: str) -> Access:
    """
    Read tokens out of lines of text.

    :param lines: as `read_access` describes them.
    :param source: where they come from, for messages.
    :return: the tokens.
    :raises AccessError: naming every mistake by its line.
    """
    grants: list[Grant] = []
    problems: list[str] = []
    for number, line in enumerate(lines, 1):
        words = line.split(maxsplit=2)
        if not words or words[0].startswith('#'):
            continue
        if len(words) > 1 and words[0] not in tuple(Role):
            problems.append(f'line {number}: write operator or viewer, then the token')
            continue
        role, token, *name = words if len(words) > 1 else [Role.OPERATOR, words[0]]
        problem = token_problem(token) or (
            'the token is there twice' if token in (grant.token for grant in grants) else ''
        )
        if problem:
            problems.append(f'line {number}: {problem}')
            continue
        grants.append(Grant(Role(role), token, plain(''.join(name), NAME)))
    if not grants and not problems:
        problems.append(f'there is no token in it: {HOW_TO}')
    if problems:
        raise AccessError('\n  '.join([f'{source}:', *problems]))
    return Access(grants)


def token_problem(token: str) -> str:
    """
    Tell why a token cannot be used.

    :param token: of at least LEAST letters, digits, "-", ".", "_" or "~".
    :return: one sentence with the remedy, '' for a good one.
    """
    if not TOKEN.fullmatch(token):
        return f'a token consists of letters, digits, "-", ".", "_" and "~": {HOW_TO}'
    if len(token) < LEAST:
        return f'the token is too short, use {LEAST} characters or more: {HOW_TO}'
    return ''
