# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The files of a bag, and the bags in a folder."""

import re
from pathlib import Path

from damadics_fd.bag.checking.stated import read_metadata
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.rosbag2 import METADATA_FILE

SUFFIXES = ('.mcap', '.mcap.zstd', '.db3', '.db3.zstd')
DEEPEST = 64  # folders within folders that are searched
_NUMBER = re.compile(r'_(\d{1,9})\.(?:mcap|db3)')


def is_bag_file(path: Path) -> bool:
    """Tell whether a file holds messages, by its name."""
    return path.name.endswith(SUFFIXES) and path.is_file()


def _by_number(path: Path) -> tuple[str, int]:
    number = _NUMBER.search(path.name)
    return (path.name[: number.start()], int(number[1])) if number else (path.name, -1)


def bag_files(path: str | Path) -> list[Path]:
    """
    List the files of one bag in order.

    :param path: file, or bag directory with or without `metadata.yaml`.
    :return: existing files.
    :raises BagError: where there are none.
    """
    path = Path(path)
    try:
        if not path.is_dir():
            if not path.exists():
                raise BagError('does not exist', path)
            return [path]
        present = sorted(filter(is_bag_file, path.iterdir()), key=_by_number)
    except (OSError, ValueError) as error:  # too long a name, a NUL in it, no permission
        raise BagError(f'cannot be read: {error}', path) from error
    stated = read_metadata(path)
    listed = [_present(path, name) for name in stated.files] if stated else []
    files = [file for file in dict.fromkeys(listed) if file in present]
    files += [file for file in present if file not in files]  # those a crash left unlisted
    if not files:
        raise BagError('holds no .mcap file; give a bag, or a folder of bags', path)
    return files


def _present(folder: Path, name: str) -> Path | None:
    """Return the file that `metadata.yaml` means: old ones name the folder, too."""
    short = Path(name).name
    plain = short.removesuffix('.zstd')
    for candidate in (short, plain, plain + '.zstd'):
        if candidate and '\0' not in candidate and is_bag_file(folder / candidate):
            return folder / candidate
    return None


def missing_files(path: str | Path) -> list[str]:
    """Tell which files `metadata.yaml` lists that are not there."""
    path = Path(path)
    stated = read_metadata(path) if path.is_dir() else None
    return [
        f'{name} is listed in {METADATA_FILE} and is not there'
        for name in (stated.files if stated else ())
        if _present(path, name) is None
    ]


def find_bags(path: str | Path) -> list[Path]:
    """
    List the bags that a path names.

    :param path: file, bag directory, or folder of such at any depth.
    :return: one path per bag; the files of a split bag count as one.
    :raises BagError: where there is none.
    """
    path = Path(path)
    if not path.is_dir():
        return [bag_files(path)[0]]
    return _bags_within(path) or ([path] if bag_files(path) else [])


def _bags_within(folder: Path, depth: int = 0) -> list[Path]:
    if (folder / METADATA_FILE).is_file():
        return [folder]
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        raise BagError(f'cannot be read: {error.strerror}', folder) from error
    files = sorted(filter(is_bag_file, entries), key=_by_number)
    names = {_by_number(file)[0] for file in files}
    kinds = {file.name.removesuffix('.zstd').rsplit('.', 1)[-1] for file in files}
    numbered = len(names) == len(kinds) == 1 and all(_by_number(file)[1] >= 0 for file in files)
    if numbered and (len(files) > 1 or folder.name in names):
        files = [folder]  # a split bag, or one that a crash left without metadata.yaml
    inner = [
        entry
        for entry in entries
        if entry.is_dir() and not entry.is_symlink() and not entry.name.startswith('.')
    ]
    if depth >= DEEPEST:
        return files
    return [*files, *(bag for entry in inner for bag in _bags_within(entry, depth + 1))]
