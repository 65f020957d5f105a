# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the `metadata.yaml` of a bag says, whoever wrote it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from damadics_fd.bag.limits import Limits
from damadics_fd.bag.rosbag2 import INTEGER, METADATA_FILE, METADATA_ROOT, Yaml, load_yaml


@dataclass(frozen=True)
class Stated:
    """
    What an existing `metadata.yaml` says about a bag.

    :param files: names of its files, in order.
    :param counts: messages by topic; empty where it is not said.
    :param messages: all of them, -1 where it is not said.
    :param compression: `FILE`, `MESSAGE` or ''.
    """

    files: tuple[str, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)
    messages: int = -1
    compression: str = ''


def read_metadata(folder: Path, limits: Limits = Limits()) -> Stated | None:
    """
    Read `metadata.yaml` of a bag directory.

    :return: None where it is absent or unreadable: the files say everything that is needed.
    """
    path = folder / METADATA_FILE
    try:
        if path.stat().st_size > limits.yaml or not path.is_file():
            return None
        text = path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError):
        return None
    loaded = load_yaml(text, limits)
    root = loaded.get(METADATA_ROOT) if isinstance(loaded, dict) else None
    if not isinstance(root, dict):
        return None
    names = root.get('relative_file_paths')
    files = tuple(n for n in names if isinstance(n, str)) if isinstance(names, list) else ()
    mode = root.get('compression_mode')
    return Stated(
        files, _counts(root), _count(root), mode.upper() if isinstance(mode, str) else ''
    )


def _count(entry: Mapping[str, Yaml]) -> int:
    text = entry.get('message_count')
    return int(text) if isinstance(text, str) and INTEGER.fullmatch(text) else -1


def _counts(root: Mapping[str, Yaml]) -> dict[str, int]:
    counts: dict[str, int] = {}
    topics = root.get('topics_with_message_count')
    for entry in topics if isinstance(topics, list) else []:
        about = entry.get('topic_metadata') if isinstance(entry, dict) else None
        name = about.get('name') if isinstance(about, dict) else None
        if isinstance(entry, dict) and isinstance(name, str) and _count(entry) >= 0:
            counts[name] = counts.get(name, 0) + _count(entry)
    return counts
