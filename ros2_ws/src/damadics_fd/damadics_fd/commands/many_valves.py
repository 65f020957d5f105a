# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of many valves: whose is which, and one parameter file for each."""

import argparse
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import yaml

from damadics_fd.bag.arrays import Columns
from damadics_fd.bag.blocks.together import read_together, source_of
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.recording import Recording
from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.commands.replay.flags import frame_id
from damadics_fd.core.settings import SettingsError
from damadics_fd.core.settings.identified import REFUSED, FaultFree, Identified
from damadics_fd.store.file_names import file_name
from damadics_fd.store.fleet_file import NAME

FLEET = 'fleet.yaml'  # the list of what was commissioned, as run and the node fleet take it
SHOWN = 8  # valves named in a message
Told = Callable[[str], None]


def by_valve(recordings: Sequence[Recording], actuator: str = '') -> dict[str, list[Recording]]:
    """
    Tell whose recordings they are: by namespace, by name in a table, else by `frame_id`.

    :param recordings: of any number of valves.
    :param actuator: tag that the user gave: then those without a namespace are of this one.
    :return: recordings by valve, `''` for the only one.
    """
    found: dict[str, list[Recording]] = {}
    for recording in recordings:
        place = recording.table.name if recording.table else recording.place.strip('/')
        if not place and not actuator:
            place = frame_id(recording)
        found.setdefault(place, []).append(recording)
    return found if len(found.keys() - {''}) > 1 else {'': list(recordings)}


def tag_of(name: str, recordings: Sequence[Recording]) -> str:
    """
    Return the tag of the actuator of a valve.

    :param name: of the valve, as `by_valve` has it.
    :param recordings: its recordings.
    :return: the tag in the recordings; the name where they have none.
    """
    return next((tag for one in recordings if (tag := frame_id(one))), '') or name


def read_all(groups: Mapping[str, Sequence[Recording]], tell: Told) -> dict[str, list[FaultFree]]:
    """
    Read the recordings of many valves, each file once.

    :param groups: recordings by valve.
    :param tell: told of damaged and odd places, which are left out.
    :return: their columns by valve, without recordings that hold nothing.
    :raises BagError: where a file cannot be read.
    """
    owner = {id(one): name for name, some in groups.items() for one in some}
    sources: dict[object, list[Recording]] = {}
    for some in groups.values():
        for one in some:
            sources.setdefault(source_of(one) or id(one), []).append(one)
    read: dict[str, list[FaultFree]] = {name: [] for name in groups}
    for together in sources.values():
        parts: list[list[Columns]] = [[] for _ in together]
        if source_of(together[0]):
            for number, piece in read_together(together, tell):
                parts[number].append(piece)
        else:
            parts[0] += together[0].chunks(tell)
        for recording, pieces in zip(together, parts, strict=True):
            columns = joined(pieces)
            if len(columns.get('stamp', ())):
                read[owner[id(recording)]].append(FaultFree(recording.name, columns))
            else:
                tell(f'{recording.name} holds no measurement')
    return read


def commission_all(
    groups: Mapping[str, Sequence[Recording]],
    options: argparse.Namespace,
    identify: Callable[[str, str, list[FaultFree], Path], Identified],
    tell: Told,
) -> list[str]:
    """
    Commission many valves, each by itself, and write their list.

    :param groups: recordings by valve.
    :param options: the command line; `out` is a folder, and so is `reference`.
    :param identify: takes name, tag, columns and parameter file of a valve, writes the latter and
        returns what was found.
    :param tell: told of damaged and odd places.
    :return: the verdict of each valve, `failed` where there is none.
    :raises BagError: where a file cannot be read.
    :raises OSError: where the folder cannot be written to.
    """
    folder = Path(options.out)
    folder.mkdir(parents=True, exist_ok=True)
    verdicts, entries = [], {}
    for name, recordings in read_all(groups, tell).items():
        tag = tag_of(name, groups[name])
        file = folder / f'{file_name(name)}.yaml'
        verdict, why = 'failed', 'its recordings hold no measurement'
        if recordings:
            try:
                verdict = identify(name, tag, recordings, file).verdict
                why = str(file) if verdict != REFUSED else f'{file} says why'
            except (CommissioningError, SettingsError, KeyError, ValueError) as error:
                why = str(error)
        print(f'{name} ({tag}): {verdict}: {why}')
        verdicts.append(verdict)
        if verdict not in ('failed', REFUSED):
            entries[valve_name(name)] = {'parameters': file.name}
    if entries:
        text = yaml.safe_dump({'valves': entries}, sort_keys=False)
        (folder / FLEET).write_text(text, encoding='utf-8')
        print(f'{len(entries)} of {len(verdicts)} valves: {folder / FLEET}')
    return verdicts


def valve_name(name: str) -> str:
    """
    Make a namespace out of the name of a valve.

    >>> valve_name('unit3/lv101'), valve_name('LV-101')
    ('unit3/lv101', 'lv_101')
    """
    if NAME.fullmatch(name):
        return name
    plain = re.sub(r'[^a-z0-9]+', '_', name.lower()).strip('_')
    return plain if NAME.fullmatch(plain) else f'v_{plain}'


def need_a_folder(groups: Mapping[str, Sequence[Recording]], options: argparse.Namespace) -> None:
    """
    Check that the command line is one for many valves.

    :param groups: recordings by valve.
    :param options: the command line.
    :raises BagError: where it is not.
    """
    names = ', '.join(list(groups)[:SHOWN]) + (', ...' if len(groups) > SHOWN else '')
    several = f'the recordings are of {len(groups)} valves ({names})'
    if '' in groups:
        raise BagError(f'{several}, and {groups[""][0].name} does not say of which')
    if options.actuator:
        raise BagError(f'{several}: leave out --actuator, or name one with --topic')
    if options.out is None or options.out.suffix in ('.yaml', '.yml') or options.out.is_file():
        raise BagError(f'{several}: name one with --topic, or give a folder with --out')
    if options.plot or options.twin:
        raise BagError(f'{several}: --plot and --twin are of one; name it with --topic')


def warn(text: str) -> None:
    """
    Tell what is left out.

    :param text: one line.
    """
    print(f'commission: {text}', file=sys.stderr)


def joined(pieces: Sequence[Columns]) -> Columns:
    """
    Return the pieces of a recording as one.

    :param pieces: columns.
    :return: those that all pieces have; without header, the log time is the stamp.
    """
    names = set.intersection(*(set(piece) for piece in pieces)) if pieces else set()
    columns = {name: np.concatenate([piece[name] for piece in pieces]) for name in names}
    if 'stamp' not in columns and 'log_time' in columns:
        columns['stamp'] = columns['log_time']
    return columns
