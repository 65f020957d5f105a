# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The reference file: what was learned from a fault-free valve, kept over restarts.

In two slots, see `slots`. It is refused with the reason where it is damaged, of another actuator
or of other settings.
"""

import time
from dataclasses import asdict, dataclass, field, fields
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from damadics_fd.core.record import Saved
from damadics_fd.core.settings import Settings
from damadics_fd.core.text import plain
from damadics_fd.ros.arguments import state_folder
from damadics_fd.store.slots import NAMES, number_of, read_slots, slot_file, write_slot

try:
    VERSION = version('damadics_fd')
except PackageNotFoundError:  # run from a source tree that was never built
    VERSION = 'unknown'
FORMAT = 'damadics_fd reference 1'
LATEST = 2**31 * 10**9  # ns; what fits into the stamp of a message
LONGEST = 1000  # characters of a path that is asked for
LATEST_CREATED = 1e12  # s since 1970
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
    learned: Saved  # Estimator.learned()
    settings: Saved  # Settings.to_dict()
    signature: Saved = field(default_factory=dict)  # Signature.save()
    source: str = ''  # bag or "live"
    first_stamp: int = 0  # ns, of the learning data
    last_stamp: int = 0
    created: float = 0.0  # s since 1970
    software: str = VERSION
    comment: str = ''
    commissioning: Saved = field(default_factory=dict)  # Identified.judgement(); {}: learned live


def save_reference(path: Path | str, reference: Reference, now: float | None = None) -> Path:
    """
    Write a reference into the older one of two slots, completely or not at all.

    :param path: path without slot and suffix, for instance `references/LC74_20`.
    :param reference: what to write.
    :param now: time to write as `created` [s since 1970]; the clock's where it is None.
    :return: the file written.
    :raises OSError: where the folder cannot be written.
    """
    created = time.time() if now is None else now
    return write_slot(path, FORMAT, {**asdict(reference), 'created': created})


def load_reference(
    path: Path | str, actuator: str | None, settings: Settings, now: float | None = None
) -> Reference:
    """
    Read the newest good slot.

    :param path: path as for `save_reference`.
    :param actuator: tag of the actuator it must belong to; None: of any.
    :param settings: the settings it must have been learned with.
    :param now: present time [s since 1970]; the clock's where it is None.
    :return: the reference.
    :raises NoReferenceError: where there is none.
    :raises ReferenceFileError: where neither slot is good, with the reason of each.
    """
    slots = read_slots(path, FORMAT)
    if not slots:
        raise NoReferenceError(f'none is kept yet in {path}')
    now = time.time() if now is None else now
    reasons = {slot_file(path, name): ' does not exist' for name in NAMES}
    for slot in slots:
        try:
            if slot.content is None:
                raise ValueError(slot.problem)
            reference = _reference(slot.content)
            _check(reference, actuator, settings, now)
            return reference
        except ValueError as error:
            reasons[slot.file] = f': {error}'
    raise ReferenceFileError('; '.join(f'{file}{text}' for file, text in reasons.items()))


def reference_path(asked: str, configured: Path | None) -> Path:
    """
    Return the file that a request means; it stays below the folder of the valve's reference.

    :param asked: name or path, '' for the configured one.
    :param configured: absolute path of the parameter `reference`; None where it is not set: then
        the folder is `references` of the user.
    :return: absolute path, without slot and suffix.
    :raises ValueError: where it is outside that folder, or there is none.
    """
    folder = configured.parent if configured else state_folder() / 'references'
    if not asked:
        if configured is None:
            raise ValueError('no file: give path, or set the parameter reference')
        return configured
    if len(asked) > LONGEST or not asked.isprintable():
        raise ValueError(f'this is no path: give a name below {folder}')
    path = (folder / asked).resolve()
    if not path.is_relative_to(folder.resolve()) or path == folder.resolve():
        raise ValueError(f'{plain(asked)} is not below {folder}: give a name without folders')
    return path


def _reference(content: Saved) -> Reference:
    try:
        learned, settings, signature = (
            _mapping(content, name) for name in ('learned', 'settings', 'signature')
        )
        actuator, source, software, comment = (
            _text(content, name) for name in ('actuator', 'source', 'software', 'comment')
        )
        created = number_of(content, 'created', 0.0, LATEST_CREATED)
        first, last = (
            int(number_of(content, name, -LATEST, LATEST))
            for name in ('first_stamp', 'last_stamp')
        )
    except KeyError as error:
        raise ValueError(f'damaged: {error} is missing') from error
    commissioning = _mapping({'commissioning': {}} | content, 'commissioning')
    if not content.keys() <= {one.name for one in fields(Reference)}:
        raise ValueError('damaged: fields are unknown')
    return Reference(
        actuator,
        learned,
        settings,
        signature,
        source,
        first,
        last,
        created,
        software,
        comment,
        commissioning,
    )


def _mapping(content: Saved, name: str) -> Saved:
    value = content[name]
    if not isinstance(value, dict):
        raise ValueError(f'damaged: {name} is no mapping')
    return value


def _text(content: Saved, name: str) -> str:
    value = content[name]
    if not isinstance(value, str):
        raise ValueError(f'damaged: {name} is no text')
    return value


@lru_cache(256)  # a fleet has thousands of valves with equal settings
def _plain(settings: Settings) -> Saved:
    return settings.to_dict()


@cache
def _defaults(mode: str) -> Saved:
    return Settings.for_mode(mode).to_dict()


def _check(reference: Reference, actuator: str | None, settings: Settings, now: float) -> None:
    if actuator is not None and reference.actuator != actuator:
        raise ValueError(f'belongs to {reference.actuator}, not to {actuator}')
    if reference.created > now + CLOCK_TOLERANCE:
        raise ValueError(
            f'was written {(reference.created - now) / 86400:.1f} days in the '
            'future: set the clock right'
        )
    present = _plain(settings)
    # a setting that is younger than the reference had its default then
    learned = {**_defaults(settings.mode), **reference.settings}
    changed = [
        f'{name} = {present[name]} was {learned[name]}'
        for name in BINDING
        if present[name] != learned[name]
    ]
    if changed:
        raise ValueError(f'was learned with other settings ({", ".join(changed)}): learn anew')
