# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keep the alarm of a detector over its restart, its kill included; what is lost is told."""

import contextlib
import os
from pathlib import Path
from typing import NamedTuple

from damadics_fd.core.record import Plain, Saved
from damadics_fd.ros.arguments import state_folder
from damadics_fd.store.claims import claim
from damadics_fd.store.slots import (
    parse,
    read_bounded,
    read_slots,
    set_aside,
    write_slot,
)

FORMAT = 'damadics_fd alarm 2'
UNKEPT = 'the alarm would not survive a restart'
REMEDY = 'end it, or give each detector an alarm_folder of its own'
FORMAT_0_1 = 'damadics_fd alarm 1'  # one file, `NAME.alarm.json`, without a hash
# what makes an alarm another one; the rest of the state changes with every sample
MARKS = (
    'active',
    'latched',
    'acknowledged',
    'occurrence',
    'worst',
    'shelved_until',
    'told',
    'unknown',
)


class LostAlarmError(ValueError):
    """There was a state, and it cannot be read."""


class Kept(NamedTuple):
    """A state that was kept, and what was wrong with its other copy."""

    state: Saved
    problem: str = ''


def default_folder() -> Path:
    """
    Return where the alarms of this ROS domain are kept.

    :return: a folder of the user.
    """
    return state_folder() / f'domain_{os.environ.get("ROS_DOMAIN_ID", "0")}'


class AlarmStore:
    """
    The state of one detector in two slots, both written at every change.

    :param path: of the slots, without their suffix: `FOLDER/NAME.alarm`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problem = ''  # why the latest state is not kept, '' if it is
        self._old = path.with_name(f'{path.name}.json')  # of version 0.1
        self._marks: list[Plain] = []
        self._claimed = f'another process keeps its alarms in {path}: {REMEDY}'

    def load(self) -> Kept | None:
        """
        Read the state.

        :return: what `Detector.load` takes; None where none was kept.
        :raises LostAlarmError: where there was one and it is damaged, with the cause.
        """
        with contextlib.suppress(OSError):  # where it cannot be written, `save` tells why
            if not claim(self.path):
                self.problem = f'{UNKEPT}: {self._claimed}'
        slots = read_slots(self.path, FORMAT)
        problems = [f'{slot.file}: {slot.problem}' for slot in slots if slot.problem]
        good = [slot.content for slot in slots if slot.content is not None]
        if good:
            return Kept(good[0], '; '.join(problems))
        if not problems:
            try:
                old = self._read_old()
            except ValueError as problem:
                problems = [f'{self._old}: {problem}']
            else:
                return None if old is None else Kept(old)
        raise LostAlarmError('; '.join(problems))

    def save(self, state: Saved, *, again: bool = False) -> None:
        """
        Write the state if the alarm has changed; what fails is told in `problem`.

        :param state: what `Detector.save` returned.
        :param again: also if it has not changed.
        """
        marks = [state[name] for name in MARKS]
        if marks == self._marks and not self.problem and not again:
            return
        try:
            if not claim(self.path):
                raise OSError(self._claimed)
            write_slot(self.path, FORMAT, state, both=True)
            self._old.unlink(missing_ok=True)
        except OSError as problem:
            self.problem = f'{UNKEPT}: {problem}'
            return
        self.problem, self._marks = '', marks

    def set_aside(self, damaged: bool = False) -> list[Path]:
        """
        Keep what is there for a person to look at; the next save takes its place.

        :param damaged: only what cannot be read.
        :return: where it is.
        :raises OSError: where the folder cannot be written.
        """
        slots = read_slots(self.path, FORMAT)
        files = [slot.file for slot in slots if slot.problem or not damaged]
        if not slots and os.path.lexists(self._old):
            files.append(self._old)
        return [set_aside(file, keep=True) for file in files]

    def _read_old(self) -> Saved | None:
        """Read a file of version 0.1."""
        try:
            document = parse(read_bounded(self._old))
        except FileNotFoundError:
            if self._old.is_symlink():
                raise ValueError('damaged: a link to nothing') from None
            return None
        except OSError as problem:
            raise ValueError(f'cannot be read: {problem.strerror}') from problem
        state = document.get('state')
        if document.get('format') != FORMAT_0_1 or not isinstance(state, dict):
            raise ValueError(f'not in the format "{FORMAT_0_1}"')
        return state
