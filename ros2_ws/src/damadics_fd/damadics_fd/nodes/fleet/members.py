# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The valves of a fleet, and one bank of monitors per mode for all of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray

from damadics_fd.core.bank.bank import Bank
from damadics_fd.core.decision.events import Event
from damadics_fd.core.record import Ints, Saved
from damadics_fd.core.result import events_in
from damadics_fd.core.settings import Settings, SettingsError
from damadics_fd.core.settings.document import parameters_in
from damadics_fd.core.signature.state import NO_CLASSES
from damadics_fd.core.text import NAME, plain
from damadics_fd.nodes.fleet.blocks import Rows, nothing
from damadics_fd.nodes.partial_strokes import AMPLITUDES, USUAL, StrokeLimits
from damadics_fd.store.fleet_file import FleetError, Valve

OF_NODES = (  # parameters of the per-valve nodes of which a fleet has its own
    'alarm_folder',
    'autostart',
    'causes_file',
    'input_timeout',
    'max_age',
    'signature_folder',
)


Number = TypeVar('Number', bound=np.generic)


@dataclass(frozen=True)
class Member:
    """Hold one valve of the fleet."""

    namespace: str  # "/lv101"
    actuator: str  # "LV-101"
    area: str
    settings: Settings
    reference: Path | None  # without ".a.json"
    measurement: str  # topic
    strokes: StrokeLimits = StrokeLimits()

    @property
    def file(self) -> str:
        """Name of its files, as the nodes of one valve name them."""
        return self.namespace.strip('/').replace('/', '__')


class Happening(NamedTuple):
    """Hold a transition of the alarm of one valve."""

    valve: int
    event: Event


class Taken(NamedTuple):
    """Hold what became of rows."""

    happened: list[Happening]  # transitions of alarms, those of a valve in the order of its rows
    refused: int  # rows
    changed: set[int]  # valves whose flag shows something else


class Members:
    """
    The valves by number, and their monitors.

    :param members: the valves; their order gives the numbers.
    :param classes: least NAMUR NE 107 class of an alarm by its cause.
    """

    def __init__(self, members: Sequence[Member], classes: Sequence[int] = NO_CLASSES) -> None:
        self.all = list(members)
        modes = [member.settings.mode for member in self.all]
        self.banks: list[Bank] = []
        self.numbers: list[Ints] = []  # of each bank: the numbers of its valves
        self._bank = np.zeros(len(self.all), np.int64)
        self._place = np.zeros(len(self.all), np.int64)
        for mode in dict.fromkeys(modes):
            numbers = np.array([n for n, one in enumerate(modes) if one == mode], np.int64)
            self._bank[numbers] = len(self.banks)
            self._place[numbers] = np.arange(len(numbers))
            self.banks.append(Bank([self.all[n].settings for n in numbers], classes))
            self.numbers.append(numbers)

    def __len__(self) -> int:
        """Return the number of valves."""
        return len(self.all)

    def at(self, valve: int) -> tuple[Bank, int]:
        """
        Find the monitor of a valve.

        :param valve: its number.
        :return: its bank, and its place there.
        """
        return self.banks[int(self._bank[valve])], int(self._place[valve])

    def warm_up(self) -> None:
        """Load the compiled loops, so that the first block need not wait for them."""
        for bank in self.banks:
            bank.take(*nothing())

    def take(self, rows: Rows) -> Taken:
        """
        Let the monitors judge samples.

        :param rows: checked rows.
        :return: what became of them.
        """
        if len(self.banks) == 1:
            return self._take(0, rows)
        together = Taken([], 0, set())
        bank = self._bank[rows.valve]
        for b in range(len(self.banks)):
            mine = bank == b
            if mine.any():
                signals = {name: column[mine] for name, column in rows.signals.items()}
                some = self._take(b, Rows(rows.valve[mine], rows.stamp[mine], signals))
                together = Taken(
                    together.happened + some.happened,
                    together.refused + some.refused,
                    together.changed | some.changed,
                )
        return together

    def _take(self, b: int, rows: Rows) -> Taken:
        alone = len(self.banks) == 1  # its places are the numbers
        place = rows.valve if alone else self._place[rows.valve]
        changes = self.banks[b].take(place, rows.stamp, rows.signals)
        refused = int(np.count_nonzero(changes.reason))
        if not len(changes.row):  # as nearly always
            return Taken([], refused, set())
        told = np.flatnonzero(changes.decisions['transitions'])
        happened = [
            Happening(int(rows.valve[changes.row[n]]), event)
            for n in told
            for event in events_in(changes.decisions[n : n + 1])
        ]
        return Taken(happened, refused, set(rows.valve[changes.row].tolist()))

    def column(self, name: str, kind: type[Number], *, estimate: bool = False) -> NDArray[Number]:
        """
        Return one field of the latest decision or estimate of every valve.

        :param name: of the field.
        :param kind: of the result.
        :param estimate: of the estimate, not of the decision.
        :return: shape (number of valves,).
        """
        out: NDArray[Number] = np.empty(len(self.all), kind)
        for bank, numbers in zip(self.banks, self.numbers, strict=True):
            out[numbers] = (bank.estimates if estimate else bank.decisions)[name]
        return out


def members_of(valves: Sequence[Valve]) -> list[Member]:
    """
    Read the settings of a list of valves.

    :param valves: the list.
    :return: the members.
    :raises FleetError: naming every valve with wrong settings.
    """
    problems: list[str] = []
    found = list(_members(valves, problems))
    if problems:
        raise FleetError('\n  '.join(['the fleet cannot run:', *problems]))
    return found


def _members(valves: Sequence[Valve], problems: list[str]) -> Iterator[Member]:
    known = {row['name'] for row in Settings.describe()}
    files: dict[Path, Saved] = {}
    made: dict[str, Settings] = {}  # thousands of valves may have equal ones
    for valve in valves:
        try:
            given: Saved = {}
            if valve.parameters:
                if valve.parameters not in files:
                    files[valve.parameters] = dict(_parameters(valve.parameters))
                given |= files[valve.parameters]
            given |= valve.settings
            actuator = plain(str(given.pop('actuator', '') or valve.name), NAME)
            reference = given.pop('reference', None)
            strokes = _stroke_limits(given)
            values = {name: value for name, value in given.items() if name not in OF_NODES}
            unknown = sorted(set(values) - known)
            if unknown:
                raise SettingsError([f'there is no setting {", ".join(unknown)}'])
            key = repr(sorted(values.items()))
            if key not in made:
                made[key] = Settings.from_mapping(values)
            settings = made[key]
        except (SettingsError, OSError, yaml.YAMLError) as problem:
            problems.append(f'{valve.name}: {problem}')
            continue
        yield Member(
            f'/{valve.name}',
            actuator,
            valve.area,
            settings,
            Path(str(reference)).expanduser() if reference else None,
            valve.topics.get('measurement', f'/{valve.name}/measurement'),
            strokes,
        )


def _stroke_limits(given: Saved) -> StrokeLimits:
    """Take out of what is given for a valve what people may ask it for."""
    allowed = given.pop('allow_partial_stroke', False)
    amplitude = given.pop('partial_stroke_limit', USUAL)
    problems = []
    if not isinstance(allowed, bool):
        problems.append(f'allow_partial_stroke = {allowed!r} is neither true nor false')
    low, high = AMPLITUDES
    if not isinstance(amplitude, int | float) or not low <= amplitude <= high:
        problems.append(f'partial_stroke_limit = {amplitude!r} is not within {low} .. {high}')
        amplitude = USUAL
    if problems:
        raise SettingsError(problems)
    return StrokeLimits(bool(allowed), float(amplitude))


def _parameters(path: Path) -> Saved:
    return dict(parameters_in(yaml.safe_load(path.read_text(encoding='utf-8'))))


def first_stamps(pending: set[int], valve: Ints, stamp: Ints) -> Iterator[tuple[int, int]]:
    """
    Yield the first stamp of each valve that is waited for, which is then waited for no longer.

    :param pending: numbers of the valves; those found are taken out.
    :param valve: of each row.
    :param stamp: of each row [ns].
    """
    for number in pending.intersection(valve.tolist()):
        pending.discard(number)
        yield number, int(stamp[np.argmax(valve == number)])
