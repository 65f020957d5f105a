# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The one way files are written that have to survive: JSON in two slots, with a hash of its content.

`NAME.a.json` and `NAME.b.json`. Each save replaces a slot as a whole, then syncs file and folder:
a kill meanwhile leaves the new one, a power cut the other. What does not fit its hash is not read.
Nothing is unpickled.
"""

import contextlib
import errno
import hashlib
import json
import os
import reprlib
import stat
import time
from dataclasses import dataclass
from pathlib import Path

from damadics_fd.core.record import Plain, Saved

NAMES = ('a', 'b')
LARGEST = 16_000_000  # bytes; a larger file is none of ours
MOST_SAVES = 2**62  # what is above was never counted to
KEPT_ASIDE = 20  # of one name; older ones go


@dataclass(frozen=True)
class Slot:
    """What one file of the two holds."""

    file: Path
    number: int = -1  # of the save; larger is newer
    content: Saved | None = None  # None where the file cannot be trusted
    problem: str = ''  # why not


def slot_file(path: Path | str, slot: str) -> Path:
    """
    Name the file of a slot.

    :param path: without slot and suffix.
    :param slot: one of NAMES.
    :return: its path.
    """
    return Path(f'{path}.{slot}.json')


def read_slots(path: Path | str, kind: str) -> list[Slot]:
    """
    Read both slots.

    :param path: without slot and suffix.
    :param kind: the format that the files have to name, e.g. "damadics_fd reference 1".
    :return: those that exist: the good ones, newest first, then the others with their problem.
    """
    found = [_slot(slot_file(path, name), kind) for name in NAMES]
    existing = [slot for slot in found if slot is not None]
    return sorted(existing, key=lambda slot: slot.number, reverse=True)


def write_slot(path: Path | str, kind: str, content: Saved, *, both: bool = False) -> Path:
    """
    Write the older slot, completely or not at all.

    :param path: without slot and suffix; its folder is made where it is missing.
    :param kind: the format that the file names.
    :param content: what `read_slots` gives back; finite numbers only.
    :param both: write the other slot too, so that damage of one of them loses nothing.
    :return: the file written first.
    :raises OSError: where it cannot be written; what `read_slots` gave stays.
    :raises ValueError: where a number is not finite.
    """
    numbers = {slot.file: slot.number for slot in read_slots(path, kind)}
    files = sorted(
        (slot_file(path, name) for name in NAMES), key=lambda file: numbers.get(file, -1)
    )
    body: Saved = {'format': kind, 'number': max([-1, *numbers.values()]) + 1, 'content': content}
    text = json.dumps({**body, 'sha256': _digest(body)}, indent=1, allow_nan=False)
    for file in files if both else files[:1]:
        _replace_slot(file, text)
    return files[0]


def replace_file(file: Path, text: str) -> None:
    """
    Put a file that has no other copy in place as a whole, once it is on the disk.

    :param file: path; its folder is made where it is missing.
    :param text: of the file.
    :raises OSError: where it cannot be written; what was there stays.
    """
    _put(file, text, first_on_disk=True)
    _sync(file.parent)


def set_aside(file: Path, keep: bool = False) -> Path:
    """
    Keep what cannot be read under another name, for a person to look at.

    :param file: what is damaged: file, link, folder.
    :param keep: it also stays where it is until the next save replaces it: a crash in between, or
        a full disk, must not make it look as if there had never been anything.
    :return: its new path, beside the old one.
    :raises OSError: where the folder cannot be written.
    """
    stem = f'{file.name}.bad-'
    target = file.with_name(f'{stem}{time.time_ns()}')
    if not (keep and _linked(file, target)):
        file.rename(target)
        if keep:
            with contextlib.suppress(OSError):
                file.symlink_to(target.name)
    older = sorted(
        p for p in file.parent.iterdir() if p.name.startswith(stem) and not _is_folder(p)
    )
    for path in older[:-KEPT_ASIDE]:
        path.unlink(missing_ok=True)
    return target


def check_folder(folder: Path) -> str:
    """
    Try whether files can be kept in a folder; it is made where it is missing.

    :param folder: path.
    :return: '' if so, otherwise one sentence. A full disk is no reason: there will be room again,
        and until then whoever keeps something there tells that he cannot.
    """
    trial = folder / f'.{os.getpid()}.tmp'
    try:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            with trial.open('w', encoding='utf-8') as stream:
                stream.write('x')
        finally:
            trial.unlink(missing_ok=True)
    except OSError as problem:
        if problem.errno not in (errno.ENOSPC, errno.EDQUOT):
            return f'cannot write into {folder}: {problem.strerror}'
    return ''


def read_bounded(file: Path, largest: int = LARGEST) -> bytes:
    """
    Read a file that may be anything: a device, a pipe, far too large.

    :param file: its path.
    :param largest: size up to which it is read.
    :return: its content.
    :raises OSError: where it cannot be opened.
    :raises ValueError: where it is no file of a sensible size.
    """
    number = os.open(file, os.O_RDONLY | os.O_NONBLOCK)  # a pipe would wait for its writer
    with os.fdopen(number, 'rb') as stream:
        kind = os.fstat(number)
        if not stat.S_ISREG(kind.st_mode):
            raise ValueError('damaged: this is no file')
        if kind.st_size > largest:
            raise ValueError(f'damaged: it has {kind.st_size} bytes')
        return stream.read(largest)


def parse(data: bytes) -> Saved:
    """
    Read a JSON object.

    :param data: bytes of a file.
    :return: the object.
    :raises ValueError: where it is none, beginning with "damaged".
    """
    try:
        document = json.loads(data, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise ValueError(f'damaged: {error}') from error
    if not isinstance(document, dict):
        raise ValueError('damaged: this is no JSON object')
    return document


def _replace_slot(file: Path, text: str) -> None:
    """Put a slot in place before the disk is waited for: a kill may come in the seconds it takes.

    A power cut meanwhile leaves the other slot, as does a disk that refuses in the end.
    """
    _put(file, text, first_on_disk=False)
    try:
        _sync(file)
        _sync(file.parent)
    except OSError:
        file.unlink(missing_ok=True)
        raise


def _put(file: Path, text: str, *, first_on_disk: bool) -> None:
    """Write a draft and give it the name; where that fails, what was there stays."""
    file.parent.mkdir(parents=True, exist_ok=True)
    draft = file.with_name(f'.{file.name}.{os.getpid()}.tmp')
    try:
        draft.write_text(text, encoding='utf-8')
        if first_on_disk:
            _sync(draft)
        draft.replace(file)
    except OSError:
        draft.unlink(missing_ok=True)
        raise


def _sync(path: Path) -> None:
    """Wait until a file, or the names of the files in a folder, are on the disk."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def _linked(file: Path, name: Path) -> bool:
    """Give what is no folder a second name; a file system may have none."""
    try:
        os.link(file, name, follow_symlinks=False)
    except OSError:
        return False
    return True


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _refuse(name: str) -> Plain:
    raise ValueError(f'the number {name} is not finite')


def _slot(file: Path, kind: str) -> Slot | None:
    try:
        document = parse(read_bounded(file))
        if document.get('format') != kind:
            raise ValueError(f'not in the format "{kind}"')
        body = {key: value for key, value in document.items() if key != 'sha256'}
        if document.get('sha256') != _digest(body):
            raise ValueError('damaged: its sha256 does not fit its content')
        number, content = document.get('number'), document.get('content')
        if not isinstance(number, int) or not 0 <= number <= MOST_SAVES:
            raise ValueError('damaged: its number is missing')
        if not isinstance(content, dict):
            raise ValueError('damaged: its content is missing')
    except FileNotFoundError:
        return _dangling(file) if file.is_symlink() else None
    except OSError as problem:
        return Slot(file, problem=f'cannot be read: {problem.strerror}')
    except ValueError as problem:
        return Slot(file, problem=str(problem))
    return Slot(file, number, content)


def _dangling(file: Path) -> Slot:
    return Slot(file, problem='damaged: a link to nothing')


def _digest(body: Saved) -> str:
    try:
        text = json.dumps(body, sort_keys=True, separators=(',', ':'), allow_nan=False)
    except (ValueError, RecursionError) as error:
        raise ValueError(f'damaged: {error}') from error
    return hashlib.sha256(text.encode('utf-8', 'surrogatepass')).hexdigest()


def number_of(content: Saved, name: str, low: float, high: float) -> float:
    """
    Take a number out of a file as carefully as out of a request.

    :param content: of the file.
    :param name: of the number.
    :param low: least value.
    :param high: greatest value.
    :return: the number.
    :raises ValueError: where it is missing, no number or out of its range.
    """
    value = content.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f'damaged: {name} is no number')
    if not low <= value <= high:  # whole numbers may be larger than any float; NaN is never within
        raise ValueError(
            f'damaged: {name} = {reprlib.repr(value)} is not within {low:g} .. {high:g}'
        )
    return value
