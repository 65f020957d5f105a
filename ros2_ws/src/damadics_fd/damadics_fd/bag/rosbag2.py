# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rosbag2 conventions: quality of service and bag metadata (version 9) as YAML."""

import re
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Union

import yaml

from damadics_fd.bag.limits import Limits

Value = str | int | bool | Mapping[str, int]
QosProfile = Mapping[str, Value]
INFINITE = {'sec': 9223372036, 'nsec': 854775807}
METADATA_FILE = 'metadata.yaml'
METADATA_ROOT = 'rosbag2_bagfile_information'
_SPANS = ('deadline', 'lifespan', 'liveliness_lease_duration')
_WORDS = ('history', 'depth', 'reliability', 'durability', 'liveliness')
_CONVENTIONS = 'avoid_ros_namespace_conventions'
_MOST_PROFILES = 100  # publishers of one topic that are kept
_PLAIN = re.compile(r'[A-Za-z/][\w/.-]*')
DEEPEST = 64  # lists and maps within each other
_BRACKET = re.compile(r'[\[\]{}]')
INTEGER = re.compile(r'-?\d{1,19}')
# scalars stay text, so that no tag and no date of a hostile file is ever made into something
_LOADER = getattr(yaml, 'CBaseLoader', yaml.BaseLoader)
_DUMPER = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)
Yaml = Union[str, list['Yaml'], dict[str, 'Yaml']]  # noqa: UP007  # what is read: no number, no date


def qos(
    reliability: str = 'reliable',
    durability: str = 'volatile',
    history: str = 'keep_last',
    depth: int = 10,
    **other: Value,
) -> QosProfile:
    """
    Describe an offered quality of service as rosbag2 writes it.

    :param other: `deadline`, `lifespan`, `liveliness`, `liveliness_lease_duration`.
    """
    profile: dict[str, Value] = {
        'history': history,
        'depth': depth,
        'reliability': reliability,
        'durability': durability,
        'deadline': INFINITE,
        'lifespan': INFINITE,
        'liveliness': 'automatic',
        'liveliness_lease_duration': INFINITE,
        _CONVENTIONS: False,
    }
    return profile | other


@dataclass
class Topic:
    """A recorded topic."""

    name: str
    type: str
    offered_qos: Sequence[QosProfile] = ()
    type_hash: str = ''
    encoding: str = 'cdr'


@dataclass
class BagFile:
    """One file of a bag."""

    path: str
    start: int = 0  # [ns] first log time
    end: int = 0  # [ns] last log time
    counts: dict[str, int] = field(default_factory=dict)  # messages by topic

    @property
    def count(self) -> int:
        """All messages in the file."""
        return sum(self.counts.values())

    def note(self, topic: str, start: int, end: int, count: int) -> None:
        """Count messages of a topic between two log times [ns]."""
        self.start = min(start, self.start) if self.counts else start
        self.end = max(end, self.end) if self.counts else end
        self.counts[topic] = self.counts.get(topic, 0) + count


@dataclass
class BagMetadata:
    """What `metadata.yaml` says about a bag."""

    topics: Sequence[Topic]
    files: Sequence[BagFile]
    custom_data: Mapping[str, str] = field(default_factory=dict)

    def to_yaml(self, root: bool = True) -> str:
        """Write it as YAML, under the root key of `metadata.yaml` or bare for the MCAP record."""
        used = [file for file in self.files if file.count]
        counts: Counter[str] = Counter()
        for file in used:
            counts.update(file.counts)
        start = min((file.start for file in used), default=0)
        end = max((file.end for file in used), default=0)
        head = dump_yaml(
            {
                'version': 9,
                'storage_identifier': 'mcap',
                'duration': {'nanoseconds': end - start},
                'starting_time': {'nanoseconds_since_epoch': start},
                'message_count': counts.total(),
            }
        )
        # by hand, because PyYAML takes a millisecond for each of perhaps thousands of topics
        entries = ''.join(_topic_yaml(topic, counts[topic.name]) for topic in self.topics)
        topics = 'topics_with_message_count:' + (f'\n{entries}' if entries else ' []\n')
        tail = dump_yaml(
            {
                'compression_format': '',
                'compression_mode': '',
                'relative_file_paths': [file.path for file in self.files],
                'files': [
                    {
                        'path': file.path,
                        'starting_time': {'nanoseconds_since_epoch': file.start},
                        'duration': {'nanoseconds': file.end - file.start},
                        'message_count': file.count,
                    }
                    for file in self.files
                ],
                'custom_data': dict(self.custom_data) or None,
                'ros_distro': 'jazzy',
            }
        )
        text = head + topics + tail
        return f'{METADATA_ROOT}:\n{textwrap.indent(text, "  ")}' if root else text


def _topic_yaml(topic: Topic, count: int) -> str:
    profiles = qos_text(topic.offered_qos)
    offered = ' []\n' if not topic.offered_qos else '\n' + textwrap.indent(profiles, '    ')
    return (
        f'- topic_metadata:\n    name: {_scalar(topic.name)}\n    type: {_scalar(topic.type)}\n'
        f'    serialization_format: {_scalar(topic.encoding)}\n    offered_qos_profiles:{offered}'
        f'    type_description_hash: {_scalar(topic.type_hash)}\n  message_count: {count}\n'
    )


def _scalar(text: str) -> str:
    """Write a string as one line of YAML."""
    if _PLAIN.fullmatch(text):
        return text
    dumped = yaml.dump(text, Dumper=_DUMPER, default_style='"', width=10**9)
    return str(dumped).removesuffix('\n')


def qos_text(profiles: Sequence[QosProfile]) -> str:
    """Write profiles as rosbag2 does in a channel."""
    frozen = tuple(
        tuple((k, tuple(v.items()) if isinstance(v, Mapping) else v) for k, v in p.items())
        for p in profiles
    )
    return _qos_text(frozen)


Frozen = tuple[tuple[str, str | int | bool | tuple[tuple[str, int], ...]], ...]


@lru_cache(maxsize=1024)
def _qos_text(frozen: tuple[Frozen, ...]) -> str:
    return dump_yaml(
        [{k: dict(v) if isinstance(v, tuple) else v for k, v in profile} for profile in frozen]
    )


class _Dumper(_DUMPER):  # type: ignore[misc, valid-type]
    """Write shared values in full: rosbag2 and people expect no YAML anchors."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def dump_yaml(data: Mapping[str, object] | Sequence[object]) -> str:
    """Write YAML in the order given, without anchors."""
    return str(yaml.dump(data, Dumper=_Dumper, sort_keys=False, width=10**9))


def load_yaml(text: str, limits: Limits = Limits()) -> Yaml | None:
    """
    Read YAML from a file of unknown origin.

    :return: its text, lists and maps; None where it is no YAML, too large or too deep.
    """
    if len(text) > limits.yaml or _too_deep(text):
        return None
    try:
        loaded: Yaml = yaml.load(text, Loader=_LOADER)
        return loaded
    except (yaml.YAMLError, ValueError, RecursionError, TypeError, KeyError, AttributeError):
        return None


def _too_deep(text: str) -> bool:
    """Tell whether lists and maps lie too deep within each other: the parser takes its time."""
    depth = 0
    for match in _BRACKET.finditer(text):
        depth += 1 if match[0] in '[{' else -1
        if depth > DEEPEST:
            return True
    return '- ' * DEEPEST in text


@lru_cache(maxsize=1024)
def parse_qos(text: str) -> tuple[QosProfile, ...]:
    """
    Read offered profiles from a channel, only what is known of them.

    >>> parse_qos('- {depth: 5, reliability: 1, deadline: {sec: 0, nsec: 1}, other: [1]}')
    ({'depth': 5, 'reliability': 1, 'deadline': {'sec': 0, 'nsec': 1}},)
    """
    loaded = load_yaml(text)
    found = loaded[:_MOST_PROFILES] if isinstance(loaded, list) else []
    return tuple(_profile(entry) for entry in found if isinstance(entry, dict))


def _profile(entry: Mapping[str, Yaml]) -> QosProfile:
    profile: dict[str, Value] = {}
    for name, value in entry.items():
        if name in _WORDS and isinstance(value, str) and len(value) < 64:
            profile[name] = int(value) if INTEGER.fullmatch(value) else value
        elif name == _CONVENTIONS and isinstance(value, str):
            profile[name] = value.lower() == 'true'
        elif name in _SPANS and isinstance(value, dict):
            parts = {part: value.get(part) for part in ('sec', 'nsec')}
            profile[name] = {
                part: int(number) if isinstance(number, str) and INTEGER.fullmatch(number) else 0
                for part, number in parts.items()
            }
    return profile
