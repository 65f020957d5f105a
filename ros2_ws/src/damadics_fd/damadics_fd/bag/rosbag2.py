# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The rosbag2 conventions: quality of service and bag metadata (version 9) as YAML."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import yaml

QosProfile = Mapping[str, Any]
INFINITE = {'sec': 9223372036, 'nsec': 854775807}
METADATA_FILE = 'metadata.yaml'
METADATA_ROOT = 'rosbag2_bagfile_information'


def qos(
    reliability: str = 'reliable',
    durability: str = 'volatile',
    history: str = 'keep_last',
    depth: int = 10,
    **other: Any,
) -> QosProfile:
    """
    Describe an offered quality of service as rosbag2 writes it.

    :param other: `deadline`, `lifespan`, `liveliness`, `liveliness_lease_duration`.
    """
    profile = {
        'history': history,
        'depth': depth,
        'reliability': reliability,
        'durability': durability,
        'deadline': INFINITE,
        'lifespan': INFINITE,
        'liveliness': 'automatic',
        'liveliness_lease_duration': INFINITE,
        'avoid_ros_namespace_conventions': False,
    }
    return profile | other


@dataclass
class Topic:
    """A recorded topic."""

    name: str
    type: str
    offered_qos: Sequence[QosProfile] = ()
    type_hash: str = ''


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
        information = {
            'version': 9,
            'storage_identifier': 'mcap',
            'duration': {'nanoseconds': end - start},
            'starting_time': {'nanoseconds_since_epoch': start},
            'message_count': counts.total(),
            'topics_with_message_count': [
                {
                    'topic_metadata': {
                        'name': topic.name,
                        'type': topic.type,
                        'serialization_format': 'cdr',
                        'offered_qos_profiles': [dict(profile) for profile in topic.offered_qos],
                        'type_description_hash': topic.type_hash,
                    },
                    'message_count': counts[topic.name],
                }
                for topic in self.topics
            ],
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
        return dump_yaml({METADATA_ROOT: information} if root else information)


class _Dumper(yaml.SafeDumper):
    """Write shared values in full: rosbag2 and people expect no YAML anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def dump_yaml(data: Any) -> str:
    """Write YAML in the order given, without anchors."""
    return str(yaml.dump(data, Dumper=_Dumper, sort_keys=False))
