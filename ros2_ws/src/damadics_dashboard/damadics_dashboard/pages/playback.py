# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recorded bag through the same estimator and detector as the live nodes, for the page."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.recording import Recording, find_recordings
from damadics_fd.causes import load_causes
from damadics_fd.commands.replay.bags import joined
from damadics_fd.core.decision.events import Event
from damadics_fd.core.field import Value
from damadics_fd.core.monitor import monitor_for
from damadics_fd.core.record import Plain
from damadics_fd.core.result import Result
from damadics_fd.core.settings import Settings, SettingsError
from damadics_fd.core.settings.document import parameters_in
from damadics_fd.core.stamps import SECOND as NANO
from damadics_fd.figures.decimation import Thinner

from damadics_dashboard.live.traces import Points, block_means, envelope
from damadics_dashboard.pages.plots import BLOCK, SMALLEST, Area
from damadics_dashboard.store.rows import EventRow

INTERVALS = 1200  # across the plots of a whole recording
RAISED, CLEARED = 0, 1
HEALTHY = 2  # and the states of an alarm; below it nothing was judged
MOST_POINTS = 4000  # of the signature

Given = dict[str, Value]  # settings by name, as a parameter file has them


class Truth(NamedTuple):
    """Which fault was simulated: the number is 0 for none."""

    fault: int
    start: float = math.nan  # s
    delay: float = math.nan  # s, until it was flagged; NaN: it was not


@dataclass
class Playback:
    """What became of one recording, with what the plots show."""

    name: str
    samples: int = 0
    duration: float = 0.0  # s
    events: list[Event] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    curves: dict[str, Points] = field(default_factory=dict)
    signature: list[Points] = field(default_factory=list)  # before and since the first alarm
    range: tuple[float, float] = (0.0, 1.0)  # s
    truth: Truth | None = None  # where the recording tells it
    monitored: bool = False  # whether it ever judged
    status: str = ''  # what the monitor said of itself in the end, in English

    @property
    def alarms(self) -> list[Event]:
        """The alarms that were raised."""
        return [event for event in self.events if event.transition == RAISED]

    def areas(self) -> list[Area]:
        """Mark the time of every alarm, for a plot."""
        begin: float | None = None
        areas = []
        for event in self.events:
            if event.transition == RAISED:
                begin = event.stamp / NANO
            elif event.transition == CLEARED and begin is not None:
                areas.append([{'xAxis': begin}, {'xAxis': event.stamp / NANO}])
                begin = None
        if begin is not None:
            areas.append([{'xAxis': begin}, {'xAxis': self.range[1]}])
        return areas

    def rows(self) -> list[EventRow]:
        """Return the transitions as the history table takes them, newest last."""
        return [
            EventRow(
                valve=self.name,
                stamp=event.stamp,
                transition=event.transition,
                occurrence=event.occurrence,
                level=event.level,
                ratio=event.ratio if math.isfinite(event.ratio) else None,
                duration=event.duration if math.isfinite(event.duration) else None,
                cause=event.cause,
                confidence=event.confidence,
                strength=event.strength,
                text=event.text,
                advice=event.advice,
            )
            for event in self.events
        ]


def settings_in_file(text: str) -> Given:
    """
    Read what describes a valve, as `commission` writes it.

    :param text: of a parameter file (YAML).
    :return: settings, `mode` among them where it is stated.
    :raises SettingsError: where it is no such file, or a value is wrong; says what.
    """
    try:
        given = parameters_in(yaml.safe_load(text))
    except yaml.YAMLError as problem:
        raise SettingsError([f'this is no parameter file: {problem}']) from problem
    known = {entry['name'] for entry in Settings.describe()}
    found = {name: _value(name, value) for name, value in given.items() if name in known}
    if not found:
        raise SettingsError(['it sets nothing of a valve: give what commission has written'])
    Settings.from_mapping(found)
    return found


def _value(name: str, value: Plain) -> Value:
    """Return a value of a file as settings take it."""
    if isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list):
        numbers = [v for v in value if isinstance(v, int | float)]
        if len(numbers) == len(value):
            return tuple(map(float, numbers))
    raise SettingsError([f'{name} is {value}: give a number, a word or a list of numbers'])


def play(path: Path, mode: str, name: str = '', settings: Given | None = None) -> list[Playback]:
    """
    Replay every valve in a file.

    :param path: an MCAP file, or a table.
    :param mode: `monitor`, `paper` or `scada`.
    :param name: that the file had where it came from.
    :param settings: that differ from the defaults of the mode.
    :return: one result per valve.
    :raises BagError: where there is nothing to replay; says why.
    :raises SettingsError: where the settings are none of this mode.
    """
    chosen = Settings.from_mapping({**(settings or {}), 'mode': mode})
    return [_play(recording, chosen, name) for recording in find_recordings([path])]


def _play(recording: Recording, settings: Settings, name: str) -> Playback:
    topic = recording.topic if recording.topic != '/measurement' else ''
    done = Playback(' '.join(filter(None, (name or recording.path.name, topic))))
    monitor, thinner = monitor_for(settings, load_causes().classes), Thinner()
    first = last = None
    for columns in joined(recording.chunks(done.problems.append)):
        result = monitor.run(columns)
        done.events += result.events
        done.monitored |= bool((np.asarray(result.decisions['state']) >= HEALTHY).any())
        done.samples += len(columns['stamp'])
        first = int(columns['stamp'][0]) if first is None else first
        last = int(columns['stamp'][-1])
        thinner.add(columns, result)
    if first is None or last is None:
        raise BagError('holds no measurement', recording.path)
    failed = monitor.estimator.failed_input
    done.status = f'the input has failed: {failed}' if failed else monitor.status
    done.duration = (last - first) / NANO
    done.range = (first / NANO, last / NANO)
    result, columns = thinner.thinned()
    _draw(done, columns, result, max((last - first) // INTERVALS, 1))
    done.truth = _truth(recording, done)
    return done


def _draw(done: Playback, columns: dict[str, np.ndarray], result: Result, width: int) -> None:
    stamp = np.asarray(columns['stamp'])
    order = np.argsort(stamp, kind='stable')
    stamp = stamp[order]
    signals = {
        'cv': columns['cv'] * 100.0,
        'x1': columns['x1'] * 100.0,
        'x2': result.estimates['x2'],
        'residual': np.maximum(result.decisions['residual'], SMALLEST),
        'threshold': np.maximum(result.decisions['threshold'], SMALLEST),
    }
    done.curves = {
        name: envelope(
            stamp, np.asarray(values)[order], width, largest=name in ('residual', 'threshold')
        )
        for name, values in signals.items()
    }
    cloud = np.zeros(len(stamp), [('stamp', 'i8'), ('x', 'f8'), ('u', 'f8')])
    cloud['stamp'] = stamp
    cloud['x'], cloud['u'] = result.estimates['x1'][order], result.estimates['u'][order]
    parts = [cloud]
    if done.alarms:
        parts = np.split(cloud, [int(np.searchsorted(stamp, done.alarms[0].stamp))])
    done.signature = [
        block_means(part, 'x', 'u', max(BLOCK, width))[:MOST_POINTS] for part in parts
    ]


def _truth(recording: Recording, done: Playback) -> Truth | None:
    """Return which fault was simulated, where the recording tells."""
    truth = recording.truth(lambda problem: None)
    if truth is None or not len(truth['fault']):
        return None
    here = np.flatnonzero(truth['fault'])
    if not len(here):
        return Truth(0)
    start = int(truth['stamp'][here[0]])
    after = [(alarm.stamp - start) / NANO for alarm in done.alarms if alarm.stamp >= start]
    return Truth(int(truth['fault'][here[0]]), start / NANO, after[0] if after else math.nan)
