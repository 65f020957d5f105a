# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keep what people did at a valve over a restart of its node."""

from dataclasses import asdict, dataclass, fields
from pathlib import Path

from damadics_fd.core.record import Plain, Saved
from damadics_fd.core.text import COMMENT, NAME, SENTENCE, plain
from damadics_fd.store.slots import number_of, read_slots, set_aside, write_slot

FORMAT = 'damadics_fd operator actions 1'
MOST = 100  # the latest, as many as the topic keeps
TEXTS = {'user': NAME, 'role': NAME, 'comment': COMMENT, 'result': SENTENCE}
LARGEST = {'action': 255, 'stamp': 2**62, 'occurrence': 2**32 - 1}


@dataclass(frozen=True)
class Act:
    """What a person did, and what came of it."""

    action: int  # one of the constants of OperatorAction
    stamp: int  # of the newest measurement [ns]
    occurrence: int  # number of the alarm it concerned, 0 if none
    user: str
    role: str
    comment: str
    done: bool
    result: str


class ActionStore:
    """
    The latest acts, in two slots.

    :param path: of the slots, without their suffix; None where nothing is kept.
    """

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._acts: list[Act] = []
        self.problem = ''  # why the latest act is not kept, or what was lost; '' if all is well

    def load(self) -> list[Act]:
        """
        Read what was kept; what cannot be read is set aside, and told in `problem`.

        :return: the acts, oldest first.
        """
        if self._path is None:
            return []
        slots = read_slots(self._path, FORMAT)
        for slot in slots:
            if slot.content is None:
                self._lose(slot.file, slot.problem)
                continue
            try:
                self._acts = self._acts or _acts_of(slot.content)
            except ValueError as problem:
                self._lose(slot.file, str(problem))
        return list(self._acts)

    def add(self, act: Act) -> None:
        """
        Keep an act.

        :param act: what was done; where it cannot be written it is with the next one.
        """
        self._acts = [*self._acts, act][-MOST:]
        if self._path is None:
            return
        rows: list[Plain] = [asdict(one) for one in self._acts]
        try:
            write_slot(self._path, FORMAT, {'acts': rows})
        except OSError as problem:
            self.problem = f'what people did would not survive a restart: {problem}'
        else:
            self.problem = ''

    def _lose(self, file: Path, problem: str) -> None:
        try:
            place = f', kept as {set_aside(file)}'
        except OSError:
            place = ''
        self.problem = f'a record of what people did is lost: {file}: {problem}{place}'


def _acts_of(content: Saved) -> list[Act]:
    """Read acts as carefully as requests."""
    rows = content.get('acts')
    if not isinstance(rows, list) or len(rows) > MOST:
        raise ValueError('damaged: no list of acts')
    return [_act_of(row) for row in rows]


def _act_of(row: Plain) -> Act:
    if not isinstance(row, dict) or set(row) != {field.name for field in fields(Act)}:
        raise ValueError('damaged: an act lacks something')
    numbers = {name: int(number_of(row, name, 0, most)) for name, most in LARGEST.items()}
    texts = {name: plain(str(row[name]), limit) for name, limit in TEXTS.items()}
    return Act(
        action=numbers['action'],
        stamp=numbers['stamp'],
        occurrence=numbers['occurrence'],
        user=texts['user'],
        role=texts['role'],
        comment=texts['comment'],
        done=row['done'] is True,
        result=texts['result'],
    )
