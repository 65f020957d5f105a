# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Message definitions: the `ros2msg` text of a schema, and where ROS keeps it."""

import json
import os
import re
import sys
from functools import cache
from pathlib import Path
from typing import NamedTuple

from damadics_fd.bag.errors import BagError

SEPARATOR = '=' * 80
PRIMITIVES = {
    'bool': 'u1',
    'byte': 'u1',
    'char': 'u1',
    'int8': 'i1',
    'uint8': 'u1',
    'int16': 'i2',
    'uint16': 'u2',
    'int32': 'i4',
    'uint32': 'u4',
    'int64': 'i8',
    'uint64': 'u8',
    'float32': 'f4',
    'float64': 'f8',
}
_FIELD = re.compile(r'^([\w/]+)(<=\d+)?(\[(<=)?(\d*)\])?\s+(\w+)(\s+.*|\s*=.*)?$')
_MOST_TYPES = 1000  # in one schema; a hostile file may say anything
_MOST_MEMBERS = 20_000  # of all its types together
_MOST_DIGITS = 10  # of the length of an array
DEEPEST = 64  # types within types
STRINGS = ('string', 'wstring')


class Member(NamedTuple):
    """One field of a message: `repeat` None is one value, -1 a sequence, otherwise an array."""

    name: str
    type: str
    repeat: int | None


Definition = dict[str, list[Member]]  # full type name, members


def full_name(name: str, package: str = '') -> str:
    """
    Complete a type name as ROS resolves it.

    >>> full_name('a/B'), full_name('B', 'a'), full_name('a/msg/B')
    ('a/msg/B', 'a/msg/B', 'a/msg/B')
    """
    if name in PRIMITIVES or name in STRINGS:
        return name
    parts = name.split('/')
    if len(parts) == 1:
        return 'std_msgs/msg/Header' if name == 'Header' else f'{package}/msg/{name}'
    return f'{parts[0]}/msg/{parts[-1]}'


def _members(text: str, package: str) -> list[Member]:
    members = []
    for line in text.splitlines():
        code = line.split('#', 1)[0].strip()
        match = _FIELD.match(code)
        if not code or (match and (match[7] or '').lstrip().startswith('=')):
            continue  # empty, comment or constant
        if not match:
            raise BagError(f'the message definition has a line that is no field: {line[:80]!r}')
        kind = full_name(match[1], package)
        if len(match[5] or '') > _MOST_DIGITS:
            raise BagError(f'the message definition has an endless array: {line[:80]!r}')
        count = None if match[3] is None else -1 if match[4] or not match[5] else int(match[5])
        members.append(Member(match[6], kind, count))
    return members


def parse_definition(name: str, text: str) -> Definition:
    """
    Parse the text of a `ros2msg` schema.

    :param name: type of the message, `package/msg/Type`.
    :param text: its definition, those of the types it contains following `MSG:` lines.
    :return: the members of each type by its full name, the message's own first.
    :raises BagError: where the text is no definition.

    >>> parse_definition('a/msg/B', 'float64[3] x  # [m]')
    {'a/msg/B': [Member(name='x', type='float64', repeat=3)]}
    """
    # up to version 0.2.0 the recorder set no line end before it, where a .msg file has none
    sections = re.split(r'={80}\r?\nMSG: *(\S+) *\r?$', text, flags=re.MULTILINE)
    if len(sections) > 2 * _MOST_TYPES:
        raise BagError(f'the schema of {name} defines more than {_MOST_TYPES} types')
    definition = {full_name(name): _members(sections[0], name.split('/')[0])}
    for kind, body in zip(sections[1::2], sections[2::2], strict=True):
        members = _members(body, kind.split('/')[0])
        if definition.setdefault(full_name(kind), members) != members:
            raise BagError(f'the schema of {name} defines {kind} twice, and differently')
    return checked(name, definition)


def checked(name: str, definition: Definition) -> Definition:
    """
    Return the definition of a message.

    :raises BagError: where it is too large, lacks a type or has two fields of one name.
    """
    if sum(map(len, definition.values())) > _MOST_MEMBERS:
        raise BagError(f'the schema of {name} has more than {_MOST_MEMBERS} fields')
    for kind, members in definition.items():
        if len({member.name for member in members}) < len(members):
            raise BagError(f'the schema of {name} has two fields of one name in {kind}')
        for member in members:
            known = member.type in PRIMITIVES or member.type in STRINGS
            if not (known or member.type in definition):
                raise BagError(f'the schema of {name} does not define {member.type}')
    return definition


def _shares() -> list[Path]:
    """Return the folders of installed interface files, as ament looks for them."""
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    return [Path(prefix, 'share') for prefix in filter(None, prefixes)]


def _share_file(name: str, suffix: str) -> Path:
    """Find an installed interface file the way ament does, then in the Python environment."""
    try:
        package, folder, short = name.split('/')
    except ValueError:
        raise BagError(f'{name!r} is not a message type; write package/msg/Type') from None
    for share in _shares():
        path = share / package / folder / (short + suffix)
        if path.is_file():
            return path
    raise BagError(
        f'no installed definition of {name}; build the workspace and source env.sh'
        ' (or install the package that defines it)'
    )


@cache
def schema_text(name: str) -> str:
    """
    Return the commented definition of an installed message type with all types it contains.

    :param name: `package/msg/Type`.
    :return: text for a schema of encoding `ros2msg`.
    :raises BagError: where the type is not installed.
    """
    bodies: dict[str, str] = {}
    waiting = [name]
    while waiting:
        kind = waiting.pop(0)
        if kind not in bodies:
            body = _share_file(kind, '.msg').read_text(encoding='utf-8')
            bodies[kind] = body if body.endswith('\n') else body + '\n'  # some files do not
            members = _members(bodies[kind], kind.split('/')[0])
            waiting += [m.type for m in members if '/' in m.type]
    top = bodies.pop(name)
    # `MSG: package/Type`, as rosbag2 writes it: strict readers look for the name that fields use
    return top + ''.join(
        f'{SEPARATOR}\nMSG: {kind.replace("/msg/", "/")}\n{text}' for kind, text in bodies.items()
    )


@cache
def type_hash(name: str) -> str:
    """
    Return the REP-2016 hash of an installed message type.

    :param name: `package/msg/Type`.
    :return: `RIHS01_` and 64 hexadecimal digits.
    :raises BagError: where the type is not installed.
    """
    hashes = json.loads(_share_file(name, '.json').read_text(encoding='utf-8'))['type_hashes']
    return str(next(entry['hash_string'] for entry in hashes if entry['type_name'] == name))


@cache
def installed_type(hash_: str) -> str:
    """
    Return the installed message type of a hash, '' where there is none.

    :param hash_: `RIHS01_` and 64 hexadecimal digits.
    """
    if not re.fullmatch(r'RIHS01_[0-9a-f]{64}', hash_):
        return ''
    for share in _shares():
        for path in sorted(share.glob('*/msg/*.json')):
            name = f'{path.parent.parent.name}/msg/{path.stem}'
            try:
                if type_hash(name) == hash_:
                    return name
            except (BagError, OSError, ValueError, KeyError, StopIteration):
                continue  # not one of rosidl
    return ''
