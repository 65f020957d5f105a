# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The reference file: what was learned from a fault-free valve, kept over restarts.

JSON in two slots, `NAME.a.json` and `NAME.b.json`. Each save replaces the older slot at once, so
that a power cut leaves the other; each carries a hash of its content and is refused with the
reason where it is damaged, of another actuator or of other settings. Nothing is ever unpickled.
"""

import hashlib
import json
import math
import os
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from damadics_fd.core.settings import Settings

try:
    VERSION = version('damadics_fd')
except PackageNotFoundError:  # run from a source tree that was never built
    VERSION = 'unknown'
FORMAT = 'damadics_fd reference 1'
SLOTS = ('a', 'b')
CLOCK_TOLERANCE = 86400.0  # s; a file from later than that is from a wrong clock
# settings that the learned numbers depend on; the others may change after learning
BINDING = (
    'mode',
    'velocity',
    'tau',
    'wn',
    'lipschitz',
    'consistent',
    'k1',
    'k2',
    'coupling',
    'alpha1',
    'alpha4',
    'alpha5',
    'delta',
    'mass',
    'stiffness',
    'stroke',
    'preload',
    'area',
    'plug_diameter',
    'gravity',
    'plug_table',
    'air_to',
    'flow_to',
    'ps_lag',
)


class ReferenceFileError(ValueError):
    """Tell why no reference could be loaded, one reason per slot."""


class NoReferenceError(ReferenceFileError):
    """There is none yet, which is how everything begins."""


@dataclass(frozen=True)
class Reference:
    """Hold what was learned, and where it comes from."""

    actuator: str  # tag, for instance "LC74_20"
    learned: dict[str, Any]  # Estimator.learned()
    settings: dict[str, Any]  # Settings.to_dict()
    signature: dict[str, Any] = field(default_factory=dict)  # Signature.save()
    source: str = ''  # bag or "live"
    first_stamp: int = 0  # ns, of the learning data
    last_stamp: int = 0
    created: float = 0.0  # s since 1970
    software: str = VERSION
    comment: str = ''


def save_reference(path: Path | str, reference: Reference, now: float | None = None) -> Path:
    """
    Write a reference into the older one of two slots, completely or not at all.

    :param path: path without slot and suffix, for instance `references/LC74_20`.
    :param reference: what to write.
    :param now: time to write as `created` [s since 1970]; the clock's where it is None.
    :return: the file written.
    :raises OSError: where the folder cannot be written.
    """
    content = {**asdict(reference), 'created': time.time() if now is None else now}
    numbers = {slot: _number(path, slot) for slot in SLOTS}
    slot = min(SLOTS, key=lambda name: numbers[name])
    document = {'format': FORMAT, 'number': max(numbers.values()) + 1, 'content': content}
    document['sha256'] = _digest(document)
    target = _file(path, slot)
    target.parent.mkdir(parents=True, exist_ok=True)
    draft = target.with_suffix('.tmp')
    with draft.open('w', encoding='utf-8') as stream:
        json.dump(document, stream, indent=1, allow_nan=False)
        stream.flush()
        os.fsync(stream.fileno())
    draft.replace(target)
    folder = os.open(target.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
    return target


def load_reference(
    path: Path | str, actuator: str, settings: Settings, now: float | None = None
) -> Reference:
    """
    Read the newest good slot.

    :param path: path as for `save_reference`.
    :param actuator: tag of the actuator it must belong to.
    :param settings: the settings it must have been learned with.
    :param now: present time [s since 1970]; the clock's where it is None.
    :return: the reference.
    :raises NoReferenceError: where there is none.
    :raises ReferenceFileError: where neither slot is good, with the reason of each.
    """
    if not any(_file(path, slot).exists() for slot in SLOTS):
        raise NoReferenceError(f'none is kept yet in {path}')
    now = time.time() if now is None else now
    found: list[tuple[int, Reference]] = []
    reasons = []
    for slot in SLOTS:
        file = _file(path, slot)
        try:
            document = _read(file)
            reference = _reference(document['content'])
            _check(reference, actuator, settings, now)
            found.append((document['number'], reference))
        except FileNotFoundError:
            reasons.append(f'{file} does not exist')
        except (OSError, ValueError) as error:
            reasons.append(f'{file}: {error}')
    if not found:
        raise ReferenceFileError('; '.join(reasons))
    return max(found, key=lambda pair: pair[0])[1]


def _file(path: Path | str, slot: str) -> Path:
    return Path(f'{path}.{slot}.json')


def _number(path: Path | str, slot: str) -> int:
    try:
        return int(_read(_file(path, slot))['number'])
    except (OSError, ValueError):
        return -1  # nothing there worth keeping


def _digest(document: Mapping[str, Any]) -> str:
    body = {key: value for key, value in document.items() if key != 'sha256'}
    text = json.dumps(body, sort_keys=True, separators=(',', ':'), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _read(file: Path) -> dict[str, Any]:
    try:
        document = json.loads(file.read_bytes())
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f'damaged: {error}') from error
    if not isinstance(document, dict) or document.get('format') != FORMAT:
        raise ValueError(f'not in the format "{FORMAT}"')
    try:
        digest = _digest(document)
    except ValueError as error:
        raise ValueError(f'damaged: {error}') from error
    if document.get('sha256') != digest:
        raise ValueError('damaged: its sha256 does not fit its content')
    if not isinstance(document.get('number'), int) or 'content' not in document:
        raise ValueError('damaged: number or content are missing')
    return document


def _reference(content: Any) -> Reference:
    known = {name: type(value) for name, value in asdict(Reference('', {}, {})).items()}
    if not isinstance(content, dict) or set(content) != set(known):
        raise ValueError('damaged: fields are missing or unknown')
    for name, value in content.items():
        number = known[name] in (int, float) and isinstance(value, (int, float))
        if not (number or isinstance(value, known[name])):
            raise ValueError(f'damaged: {name} is no {known[name].__name__}')
    return Reference(**content)


def _check(reference: Reference, actuator: str, settings: Settings, now: float) -> None:
    if reference.actuator != actuator:
        raise ValueError(f'belongs to {reference.actuator}, not to {actuator}')
    if reference.created > now + CLOCK_TOLERANCE or not math.isfinite(reference.created):
        raise ValueError(
            f'was written {(reference.created - now) / 86400:.1f} days in the '
            'future: set the clock right'
        )
    present = settings.to_dict()
    # a setting that is younger than the reference had its default then
    learned = {**Settings.for_mode(settings.mode).to_dict(), **reference.settings}
    changed = [
        f'{name} = {present[name]} was {learned[name]}'
        for name in BINDING
        if present[name] != learned[name]
    ]
    if changed:
        raise ValueError(f'was learned with other settings ({", ".join(changed)}): learn anew')
