# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Many recordings at once: over the cores of this machine, or the workers of a cluster."""

import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed, wait
from dataclasses import replace as changed
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from typing import NoReturn

from tqdm import tqdm

from damadics_fd.bag.blocks.together import source_of
from damadics_fd.bag.mcap import loading
from damadics_fd.bag.recording import Recording
from damadics_fd.commands.cluster import cluster
from damadics_fd.commands.replay.bags import Plan, replay_together, warm_up
from damadics_fd.commands.replay.outcome import Outcome

BESIDE = Path()  # bags with the flags go next to the inputs
MOST_VALVES, FEW_VALVES = 2000, 50  # of one file in one pass; with files of their own
CLUSTER = 8  # parts of one file for the workers of a cluster
Task = tuple[list[Recording], Plan, list[str]]
_counter: 'Synchronized[int]'  # samples done by all workers


def replay_all(
    recordings: Sequence[Recording],
    stems: Sequence[str],
    plan: Plan,
    jobs: int,
    scheduler: str | None = None,
) -> list[Outcome]:
    """
    Replay recordings over several processes with a progress bar.

    :param recordings: what to replay.
    :param stems: file name of each without suffix.
    :param plan: how.
    :param jobs: processes at most.
    :param scheduler: address of a Dask scheduler whose workers do it instead, and see the files
        under the same paths.
    :return: what became of each, in order.
    """
    groups = grouped(recordings, plan, jobs if scheduler is None else CLUSTER)
    tasks: list[Task] = [
        (
            [recordings[n] for n in group],
            _placed(plan, recordings[group[0]]),
            [stems[n] for n in group],
        )
        for group in groups
    ]
    outcomes: dict[int, Outcome] = {}
    with tqdm(unit=' samples', unit_scale=True, disable=None, leave=False) as bar:
        for group, done in zip(groups, _results(tasks, plan, jobs, scheduler, bar), strict=True):
            outcomes |= dict(zip(group, done, strict=True))
    return [outcomes[number] for number in range(len(recordings))]


def _results(
    tasks: Sequence[Task], plan: Plan, jobs: int, scheduler: str | None, bar: 'tqdm[NoReturn]'
) -> list[list[Outcome]]:
    if scheduler is not None:
        with cluster(scheduler) as executor:
            futures = [executor.submit(replay_together, *task) for task in tasks]
            for future in as_completed(futures):
                bar.update(sum(outcome.samples for outcome in future.result()))
            return [future.result() for future in futures]
    workers = min(jobs, len(tasks))
    if workers <= 1:
        warm_up([plan])
        return [replay_together(*task, bar.update) for task in tasks]
    context = multiprocessing.get_context('spawn')
    counter = context.Value('q', 0)
    with ProcessPoolExecutor(
        workers, context, initializer=_start, initargs=(counter, plan, workers)
    ) as pool:
        waiting = futures = [pool.submit(_work, *task) for task in tasks]
        while waiting:
            waiting = list(wait(waiting, timeout=0.2).not_done)
            bar.update(counter.value - bar.n)
        return [future.result() for future in futures]


def grouped(recordings: Sequence[Recording], plan: Plan, jobs: int) -> list[list[int]]:
    """
    Put together the valves of one file that one process replays in one pass.

    :param recordings: what to replay.
    :param plan: how; what writes files of its own has but few of them open at once.
    :param jobs: processes that share the valves of a file.
    :return: numbers of recordings, each once.
    """
    most = FEW_VALVES if plan.bags or plan.figures else MOST_VALVES
    sources: dict[object, list[int]] = {}
    for number, recording in enumerate(recordings):
        sources.setdefault(source_of(recording) or number, []).append(number)
    groups = []
    for numbers in sources.values():
        size = min(most, -(-len(numbers) // jobs))
        groups += [numbers[at : at + size] for at in range(0, len(numbers), size)]
    return groups


def _placed(plan: Plan, recording: Recording) -> Plan:
    """Put bags next to the input where no folder is given."""
    if plan.bags != BESIDE:
        return plan
    return changed(plan, bags=recording.path.resolve().parent)


def _start(counter: 'Synchronized[int]', plan: Plan, workers: int) -> None:
    global _counter
    _counter = counter
    loading.THREADS = max(1, loading.THREADS // workers)  # the cores are busy
    warm_up([plan])


def _work(recordings: list[Recording], plan: Plan, stems: list[str]) -> list[Outcome]:
    def progress(count: int) -> None:
        with _counter.get_lock():
            _counter.value += count

    return replay_together(recordings, plan, stems, progress)
