# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Run a recording through estimator and detector, piece by piece, without ROS."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from damadics_fd.bag.arrays import Columns
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
        return monitor_for(settings, load_causes().classes).starting_from(self.learned)


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
    outcome = Outcome(recording.name, plan.mode)
    try:
        _replay(recording, plan, outcome, progress, stem or Path(recording.path).stem)
    except (BagError, OSError, RuntimeError) as error:
        outcome.error = str(error)
    return outcome


def _replay(
    recording: Recording, plan: Plan, outcome: Outcome, progress: Callable[[int], None], stem: str
) -> None:
    monitor = plan.monitor()
    zero = first = last = None
    flags = FlagWriter(plan.bags / f'{stem}_flags.mcap', recording) if plan.bags else None
    thinner = Thinner() if plan.figures else None
    forces = ForceMap(monitor.signature) if plan.figures and plan.mode == 'monitor' else None
    lacking = set(NEEDED[plan.mode])
    spent = 0.0
    pieces = joined(recording.chunks(outcome.problems.append))
    try:
        while True:
            began = time.perf_counter()
            columns = next(pieces, None)
            if columns is None:
                break
            stamp = columns['stamp']
            lacking &= {name for name in lacking if np.isnan(columns.get(name, np.nan)).all()}
            if (stamp < 0).any():
                raise BagError('has stamps that have rolled over: see verify', recording.name)
            if zero is None or first is None:
                zero, first = origin(int(stamp[0])), int(stamp[0])
            last = int(stamp[-1])
            result = monitor.run(columns) if flags or thinner else None
            events = result.events if result else monitor.events(columns)
            spent += time.perf_counter() - began
            collect(outcome.detections, events, zero)
            outcome.samples += len(stamp)
            if result and flags:
                flags.write(result)
            if result and thinner:
                thinner.add(columns, result)
            if result and forces:
                forces.add(result.estimates[result.accepted])
            progress(len(stamp))
    finally:
        if flags:
            flags.close()
    if first is None or last is None:
        raise BagError('has no measurement: the topic is empty', recording.name)
    outcome.duration_s = (last - first) / SECOND
    outcome.samples_per_s = outcome.samples / spent
    outcome.lossy = bool(outcome.problems) and not recording.table
    outcome.refused, outcome.status = monitor.refused, monitor.status
    rate = outcome.samples / max(outcome.duration_s, 1e-9)
    if plan.mode == 'scada' and rate > FAST:
        outcome.status += f'; samples at {rate:.0f} Hz, for which there is --mode monitor'
    _judge_refused(outcome, lacking)
    if thinner and plan.figures:
        _draw(thinner, recording, outcome, plan.figures / f'{stem}.png')
    if forces and plan.figures and monitor.signature.view().state >= STATE_VERIFY:
        force_over_position(
            forces,
            monitor.signature,
            plan.figures / f'{stem}_signature.png',
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
