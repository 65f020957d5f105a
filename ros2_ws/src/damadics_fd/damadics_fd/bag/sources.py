# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The files of a bag, and the bags in a folder."""

import re
from pathlib import Path

import yaml

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.rosbag2 import METADATA_FILE, METADATA_ROOT

SUFFIXES = ('.mcap', '.mcap.zstd')


def is_mcap(path: Path) -> bool:
    """Tell whether a file is an MCAP file by its name."""
    return path.is_file() and path.name.endswith(SUFFIXES)


def _by_number(path: Path) -> tuple[str, int]:
    number = re.search(r'_(\d+)\.mcap', path.name)
    return (path.name[: number.start()], int(number[1])) if number else (path.name, -1)


def bag_files(path: str | Path) -> list[Path]:
    """
    List the MCAP files of one bag in order.

    :param path: MCAP file, or bag directory with or without `metadata.yaml`.
    :return: existing files.
    :raises BagError: where there are none.
    """
    path = Path(path)
    if not path.is_dir():
        if not path.exists():
            raise BagError('does not exist', path)
        return [path]
    present = sorted(filter(is_mcap, path.iterdir()), key=_by_number)
    listed = [path / name for name in _listed(path / METADATA_FILE)]
    files = [file for file in listed if file in present]
    files += [file for file in present if file not in files]  # those a crash left unlisted
    if not files:
        foreign = next(path.glob('*.db3'), None)
        raise BagError(
            'is an SQLite bag; convert it: ros2 bag convert with storage_id mcap'
            if foreign
            else 'holds no .mcap file; give a bag, or a folder of bags',
            path,
        )
    return files


def _listed(metadata: Path) -> list[str]:
    """Return the file names in `metadata.yaml`, none where it is absent or unreadable."""
    try:
        information = yaml.safe_load(metadata.read_text(encoding='utf-8'))[METADATA_ROOT]
        return [str(name) for name in information['relative_file_paths']]
    except (OSError, UnicodeDecodeError, yaml.YAMLError, TypeError, KeyError):
        return []  # the files themselves say everything that is needed


def find_bags(path: str | Path) -> list[Path]:
    """
    List the bags that a path names.

    :param path: MCAP file, bag directory, or folder of such at any depth.
    :return: one path per bag; the files of a split bag count as one.
    :raises BagError: where there is none.
    """
    path = Path(path)
    if not path.is_dir():
        return [bag_files(path)[0]]
    return _bags_within(path) or ([path] if bag_files(path) else [])


def _bags_within(folder: Path) -> list[Path]:
    if (folder / METADATA_FILE).is_file():
        return [folder]
    entries = sorted(folder.iterdir())
    files = sorted(filter(is_mcap, entries), key=_by_number)
    names = {_by_number(file)[0] for file in files}
    numbered = len(names) == 1 and all(_by_number(file)[1] >= 0 for file in files)
    if numbered and (len(files) > 1 or folder.name in names):
        files = [folder]  # a split bag, or one that a crash left without metadata.yaml
    inner = [
        entry
        for entry in entries
        if entry.is_dir() and not entry.is_symlink() and not entry.name.startswith('.')
    ]
    return [*files, *(bag for entry in inner for bag in _bags_within(entry))]
