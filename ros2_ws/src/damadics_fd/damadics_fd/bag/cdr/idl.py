# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Message definitions as IDL: what rosbag2 keeps (`ros2idl`) of types without a .msg file."""

import re

from damadics_fd.bag.cdr.definition import (
    PRIMITIVES,
    STRINGS,
    Definition,
    Member,
    checked,
    full_name,
)
from damadics_fd.bag.errors import BagError

LONGEST = 1 << 20  # [B] of text
_NAMES = {
    'boolean': 'bool',
    'octet': 'byte',
    'short': 'int16',
    'long': 'int32',
    'long long': 'int64',
    'unsigned short': 'uint16',
    'unsigned long': 'uint32',
    'unsigned long long': 'uint64',
    'float': 'float32',
    'double': 'float64',
}
_BESIDES = re.compile(  # texts, comments, #include, what parts the types, annotations
    r'"(?:[^"\\\n]|\\.)*(?:"|$)|//[^\n]*|/\*.*?(?:\*/|\Z)|^[ \t]*#[^\n]*|^={80}$|^IDL:[^\n]*',
    re.MULTILINE | re.DOTALL,
)
_ANNOTATION = re.compile(r'@\w+\s*(?:\([^()]*\))?')
_TOKEN = re.compile(r'\w+(?:\s*::\s*\w+)*|[^\s\w]')


class _Parser:
    """Read the types of a text, token by token."""

    def __init__(self, text: str):
        plain = _ANNOTATION.sub(' ', _BESIDES.sub(' ', text))
        self._tokens = [re.sub(r'\s', '', token) for token in _TOKEN.findall(plain)]
        self._at = 0
        self._modules: list[str] = []
        self._aliases: dict[str, tuple[str, int | None]] = {}  # by full name, as in a `Member`
        self.types: Definition = {}

    def _next(self, *wanted: str) -> str:
        token = self._tokens[self._at] if self._at < len(self._tokens) else 'its end'
        if wanted and token not in wanted:
            raise BagError(f'the IDL definition has {token[:40]!r} instead of {wanted[0]!r}')
        self._at += 1
        return token

    def _take(self, token: str) -> bool:
        found = self._tokens[self._at : self._at + 1] == [token]
        self._at += found
        return found

    def parse(self) -> Definition:
        """Return all types by their full names."""
        while self._at < len(self._tokens):
            token = self._next()
            if token == 'module':
                self._modules.append(self._next())
                self._next('{')
            elif token == '}' and self._modules:
                self._modules.pop()
            elif token == 'struct':
                self._struct(self._name(self._next()))
            elif token == 'typedef':
                name, kind, repeat = self._member()
                self._aliases[self._name(name)] = kind, repeat
            elif token == 'enum':
                self._aliases[self._name(self._next())] = 'uint32', None
                self._skip('}')
            elif token == 'const':
                self._skip(';')
            elif token != ';':
                raise BagError(f'the IDL definition has {token[:40]!r} where a type should be')
        return self.types

    def _skip(self, end: str) -> None:
        while self._next() != end:
            if self._at >= len(self._tokens):
                raise BagError('the IDL definition ends too early')

    def _name(self, short: str) -> str:
        """Return the full name of a type that is defined, or meant, here."""
        parts = short.split('::')
        return full_name('/'.join(parts if len(parts) > 1 else [*self._modules[:1], short]))

    def _struct(self, name: str) -> None:
        self._next('{')
        members = []
        while not self._take('}'):
            members.append(Member(*self._member()))
        if self.types.setdefault(name, members) != members:
            raise BagError(f'the IDL definition has {name[:40]} twice, and differently')

    def _member(self) -> tuple[str, str, int | None]:
        """Read type, name and length of an array up to the semicolon."""
        kind, repeat = self._type()
        name = self._next()
        while self._take('['):
            if repeat is not None:
                raise BagError(f'the IDL definition has arrays of arrays: {name[:40]}')
            repeat = self._count()
            self._next(']')
        self._next(';')
        return name, kind, repeat

    def _count(self) -> int:
        token = self._next()
        if not (token.isascii() and token.isdigit() and len(token) <= 10):
            raise BagError(f'the IDL definition has the length {token[:40]!r}')
        return int(token)

    def _type(self) -> tuple[str, int | None]:
        word = self._next()
        if word == 'sequence':
            self._next('<')
            kind, repeat = ('', 0) if self._take('sequence') else self._type()
            if repeat is not None:
                raise BagError('the IDL definition has sequences of arrays')
            if self._take(','):
                self._count()
            self._next('>')
            return kind, -1
        if word in STRINGS:
            if self._take('<'):
                self._count()
                self._next('>')
            return word, None
        if word == 'unsigned':
            word += ' ' + self._next('long', 'short')
        if word.endswith('long') and self._take('long'):
            word += ' long'
        known = _NAMES.get(word, word)
        if known in PRIMITIVES:
            return known, None
        name = self._name(word)
        return self._aliases.get(name, (name, None))


def parse_idl(name: str, text: str) -> Definition:
    """
    Parse the text of a `ros2idl` schema.

    :param name: type of the message, `package/msg/Type`.
    :param text: IDL of this type and of those that it contains.
    :return: the members of each type by its full name, the message's own first.
    :raises BagError: where the text is no such definition.

    >>> parse_idl('a/msg/B', 'module a { module msg { struct B { sequence<long> x; }; }; };')
    {'a/msg/B': [Member(name='x', type='int32', repeat=-1)]}
    """
    if len(text) > LONGEST:
        raise BagError(f'the schema of {name} is longer than {LONGEST} characters')
    types = _Parser(text).parse()
    own = full_name(name)
    if own not in types:
        raise BagError(f'the schema of {name} does not define it')
    return checked(name, {own: types[own]} | types)
