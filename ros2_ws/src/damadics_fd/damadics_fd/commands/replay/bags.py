# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Run a recording through estimator and detector, piece by piece, without ROS."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from damadics_fd.bag.arrays import Columns
from damadics_fd.bag.blocks.together import read_together, source_of
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.recording import Recording
from damadics_fd.causes import load_causes
from damadics_fd.commands.replay.flags import FlagWriter
from damadics_fd.commands.replay.outcome import Outcome, collect
from damadics_fd.core.monitor import Chain, monitor_for
from damadics_fd.core.quality import EXPLANATIONS, REMEDIES
from damadics_fd.core.record import Saved
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.state import STATE_VERIFY
from damadics_fd.core.stamps import SECOND, origin
from damadics_fd.figures.decimation import Thinner
from damadics_fd.figures.valve_signature import ForceMap, force_over_position

NO_RESULT = 0.9  # share of refused samples from which on nothing was monitored
FAST = 5.0  # Hz; mode scada is for the second of a control room
NEEDED = {
    'paper': ('cv', 'x1'),
    'scada': ('cv', 'x1'),
    'monitor': ('cv', 'x1', 'p1', 'p2', 'ps'),
}
PIECE = 8192  # rows judged at once: they fit the cache, and calls cost nothing against them


@dataclass(frozen=True)
class Plan:
    """
    How to replay.

    :param mode: paper, monitor or scada.
    :param settings: settings that differ from the defaults of the mode.
    :param figures: folder for pictures, None for none.
    :param bags: folder for bags with the flags, None for none.
    :param learned: what the estimator begins with, as a reference keeps it; None: nothing.
    """

    mode: str = 'monitor'
    settings: Saved = field(default_factory=dict)
    figures: Path | None = None
    bags: Path | None = None
    learned: Saved | None = None

    def monitor(self) -> Chain:
        """Return the monitor in its first state."""
        settings = Settings.for_mode(self.mode, **self.settings)
        return monitor_for(settings, _classes()).starting_from(self.learned)


@cache
def _classes() -> Sequence[int]:
    """Return the class of each cause; read once, not for each valve of a thousand."""
    return load_causes().classes


def replay(
    recording: Recording,
    plan: Plan,
    progress: Callable[[int], None] = lambda count: None,
    stem: str = '',
) -> Outcome:
    """
    Replay one recording.

    :param recording: what to replay.
    :param plan: how.
    :param progress: told the number of samples of each piece.
    :param stem: file name without suffix for pictures and bags.
    :return: what became of it; where it cannot be read, `error` says why.
    """
    return replay_together([recording], plan, [stem or recording.path.stem], progress)[0]


def replay_together(
    recordings: Sequence[Recording],
    plan: Plan,
    stems: Sequence[str],
    progress: Callable[[int], None] = lambda count: None,
) -> list[Outcome]:
    """
    Replay one recording, or several of one file in one pass.

    :param recordings: one, or such as `source_of` tells to lie together.
    :param plan: how.
    :param stems: file name of each without suffix, for pictures and bags.
    :param progress: told the number of samples of each piece.
    :return: what became of each; where it cannot be read, `error` says why.
    """
    outcomes = [Outcome(one.name, plan.mode) for one in recordings]
    told: list[str] = []  # of the file, whichever valve it concerns
    players: dict[int, Player] = {}
    try:
        pieces: Iterator[tuple[int, Columns]]
        if source_of(recordings[0]):
            pieces = read_together(recordings, told.append)
        else:
            pieces = ((0, piece) for piece in joined(recordings[0].chunks(told.append)))
        began = time.perf_counter()
        for number, columns in pieces:
            outcome = outcomes[number]
            if not outcome.error:
                try:
                    if number not in players:
                        players[number] = Player(recordings[number], plan, stems[number], outcome)
                    players[number].take(columns)
                except (BagError, OSError, RuntimeError) as error:
                    outcome.error = str(error)
            progress(len(columns['stamp']))
            now = time.perf_counter()
            outcome.spent += now - began
            began = now
    except (BagError, OSError, RuntimeError) as error:
        for outcome in outcomes:
            outcome.error = outcome.error or str(error)
    finally:
        for player in players.values():
            player.close()
    for number, outcome in enumerate(outcomes):
        outcome.problems += told
        if outcome.error:
            continue
        try:
            if number in players:
                players[number].finish()
            else:
                _without_rows(recordings[number], outcome)
        except (BagError, OSError, RuntimeError) as error:
            outcome.error = str(error)
    return outcomes


def _without_rows(recording: Recording, outcome: Outcome) -> None:
    """Tell of a valve without a sample: others of the same file may well have some."""
    if not source_of(recording):
        raise BagError('has no measurement: the topic is empty', recording.name)
    outcome.status = 'no sample in the blocks' if recording.valve else 'no sample'
    outcome.lossy = bool(outcome.problems)


class Player:
    """
    Judge one recording piece by piece.

    :param recording: what is replayed.
    :param plan: how.
    :param stem: file name without suffix for pictures and bags.
    :param outcome: what becomes of it.
    """

    def __init__(self, recording: Recording, plan: Plan, stem: str, outcome: Outcome) -> None:
        self._recording, self._plan, self._stem = recording, plan, stem
        self._outcome = outcome
        self._monitor = plan.monitor()
        drawn = plan.figures is not None
        self._flags = (
            FlagWriter(plan.bags / f'{stem}_flags.mcap', recording) if plan.bags else None
        )
        self._thinner = Thinner() if drawn else None
        self._forces = (
            ForceMap(self._monitor.signature) if drawn and plan.mode == 'monitor' else None
        )
        self._lacking = set(NEEDED[plan.mode])
        self._zero = self._first = self._last = -1
        self._span = 0  # ns

    def take(self, columns: Columns) -> None:
        """
        Judge the next rows.

        :param columns: at least one row.
        :raises BagError: where the recording cannot be judged.
        """
        stamp, lacking = columns['stamp'], self._lacking
        lacking &= {name for name in lacking if np.isnan(columns.get(name, np.nan)).all()}
        if (stamp < 0).any():
            raise BagError('has stamps that have rolled over: see verify', self._recording.name)
        if self._first < 0:
            self._zero, self._first = origin(int(stamp[0])), int(stamp[0])
        steps = np.diff(stamp, prepend=stamp[0] if self._last < 0 else self._last)
        self._span += int(steps[steps > 0].sum())  # a clock that was set back took no time away
        self._last = int(stamp[-1])
        result = self._monitor.run(columns) if self._flags or self._thinner else None
        events = result.events if result else self._monitor.events(columns)
        collect(self._outcome.detections, events, self._zero)
        self._outcome.samples += len(stamp)
        if result and self._flags:
            self._flags.write(result)
        if result and self._thinner:
            self._thinner.add(columns, result)
        if result and self._forces:
            self._forces.add(result.estimates[result.accepted])

    def close(self) -> None:
        """Finish the bag with the flags, whatever has come about."""
        if self._flags:
            self._flags.close()

    def finish(self) -> None:
        """
        Complete the outcome.

        :raises BagError: where there is no result.
        """
        outcome, plan, recording = self._outcome, self._plan, self._recording
        outcome.duration_s = self._span / SECOND
        outcome.samples_per_s = outcome.samples / outcome.spent
        outcome.lossy = bool(outcome.problems) and not recording.table
        outcome.refused, outcome.status = self._monitor.refused, self._monitor.status
        rate = outcome.samples / max(outcome.duration_s, 1e-9)
        if plan.mode == 'scada' and rate > FAST:
            outcome.status += f'; samples at {rate:.0f} Hz, for which there is --mode monitor'
        _judge_refused(outcome, self._lacking)
        if self._thinner and plan.figures:
            _draw(self._thinner, recording, outcome, plan.figures / f'{self._stem}.png')
        signature = self._monitor.signature
        if self._forces and plan.figures and signature.view().state >= STATE_VERIFY:
            force_over_position(
                self._forces,
                signature,
                plan.figures / f'{self._stem}_signature.png',
                Path(recording.name).name.removesuffix('.mcap'),
            )


def _judge_refused(outcome: Outcome, lacking: set[str]) -> None:
    """Say why most samples were refused; where nearly all were, there is no result."""
    refused = sum(outcome.refused.values())
    if 2 * refused < outcome.samples:
        return
    reason = max(outcome.refused, key=lambda name: outcome.refused[name])
    why = f'{EXPLANATIONS[reason]}; {REMEDIES[reason]}'
    if lacking:
        why = (
            f'{", ".join(sorted(lacking))} not measured, but mode {outcome.mode} needs'
            f' {", ".join(NEEDED[outcome.mode])}: name the signals with --map, or take'
            ' another --mode'
        )
    text = f'{refused} of {outcome.samples} samples were refused ({reason}): {why}'
    if refused >= NO_RESULT * outcome.samples:
        raise BagError(text, outcome.bag)
    outcome.problems.append(f'{outcome.bag}: {text}')


def joined(pieces: Iterable[Columns]) -> Iterator[Columns]:
    """Join short pieces to `PIECE` rows or more; without header, the log time is the stamp."""
    waiting: list[Columns] = []
    for piece in pieces:
        if 'stamp' not in piece:
            piece = {**piece, 'stamp': piece['log_time']}
        waiting.append(piece)
        if sum(len(part['stamp']) for part in waiting) >= PIECE:
            yield _join(waiting)
            waiting = []
    if any(len(part['stamp']) for part in waiting):
        yield _join(waiting)


def _join(pieces: list[Columns]) -> Columns:
    if len(pieces) == 1:
        return pieces[0]
    names = [name for name in pieces[0] if all(name in piece for piece in pieces)]
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in names}


def _draw(thinner: Thinner, recording: Recording, outcome: Outcome, path: Path) -> None:
    from damadics_fd.figures.panels import six_panels

    result, columns = thinner.thinned()
    truth = recording.truth(outcome.problems.append)
    if truth is not None and len(truth['stamp']):
        index = np.searchsorted(truth['stamp'], columns['stamp'], side='right') - 1
        for name in ('fault', 'strength'):
            columns[name] = truth[name][np.clip(index, 0, None)]
    six_panels(result, columns, path, f'{Path(recording.name).name}, mode {outcome.mode}')


def warm_up(plans: Sequence[Plan]) -> None:
    """Load or compile the loops, so that the first recording is not slower than the next."""
    columns: Columns = {name: np.array([0.5]) for name in SIGNALS}
    for plan in plans:
        plan.monitor().events({'stamp': np.array([1]), **columns})
