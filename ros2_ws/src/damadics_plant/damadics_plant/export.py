# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Runs to files: one with a progress bar, many over all cores; memory stays bounded."""

import multiprocessing
import os
import shutil
import signal
from collections.abc import Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from tqdm import tqdm

from damadics_plant.actuator.parameters import Actuator
from damadics_plant.scenarios.scenario import Scenario
from damadics_plant.simulator import Simulator
from damadics_plant.writer import BYTES_PER_SAMPLE, open_writer

ALL = 'all44'
"""Stands for the benchmark's 44 standard scenarios."""

_BLOCK = 1 << 14
_BAR = '{l_bar}{bar}| {n:.0f}/{total:.0f} s [{elapsed}<{remaining}, {rate_fmt}]'


class Stop(Protocol):
    """An event that asks to end early."""

    def is_set(self) -> bool:
        """
        Tell whether to end.

        :return: True once it was set.
        """


@dataclass(frozen=True)
class Job:
    """One run and the file it goes to."""

    scenario: Scenario
    out: Path
    rate: float | None = None
    model: str | Actuator = 'dablib'
    noise: bool = False
    seed: int = 0

    def simulator(self) -> Simulator:
        """
        Put the plant to the start of the run.

        :return: the simulator.
        :raises ValueError: if a value is not admissible.
        """
        return Simulator(self.scenario, self.rate, self.model, self.noise, self.seed)


def run_one(job: Job, stop: Stop, scada: Path | None = None, bar: bool = False) -> bool:
    """
    Run a scenario into a file, block by block.

    :param job: the run.
    :param stop: asks to end after the present block; the file is whole then, too.
    :param scada: also write every second of the same run here.
    :param bar: show a progress bar where the error output is a terminal.
    :return: False if it was stopped.
    :raises ValueError: if a value is not admissible.
    :raises OSError: if a file cannot be written.
    """
    simulator = job.simulator()
    every = round(simulator.rate)
    if scada and not np.isclose(every, simulator.rate):
        raise ValueError(f'--scada: a rate of {simulator.rate:g} Hz has no sample each second')
    _check_space(job.out, [job])
    with ExitStack() as stack:
        write = stack.enter_context(open_writer(job.out))
        write_scada = stack.enter_context(open_writer(scada)) if scada else None
        progress = stack.enter_context(
            tqdm(
                total=simulator.duration,
                unit=' s',
                bar_format=_BAR,
                unit_scale=True,
                desc=job.scenario.name,
                disable=None if bar else True,
            )
        )
        while not simulator.finished and not stop.is_set():
            first = round(simulator.time * simulator.rate)
            columns = simulator.advance(_BLOCK)
            write(columns)
            if write_scada:
                write_scada(_thinned(columns, -first % every, every))
            progress.update(min(simulator.time, simulator.duration) - progress.n)
    return simulator.finished


def run_all(jobs: Sequence[Job], extension: str, stop: Stop, bar: bool = False) -> bool:
    """
    Run scenarios into the files of a folder, one process per core.

    :param jobs: the runs; `out` is the folder, a file is named after its scenario.
    :param extension: `csv` or `mcap`.
    :param stop: asks to end after the present blocks.
    :param bar: show a progress bar where the error output is a terminal.
    :return: False if it was stopped.
    :raises ValueError: if a value is not admissible.
    :raises OSError: if a file cannot be written.
    """
    for job in jobs:
        job.simulator()  # raises before any work is done
    _check_space(jobs[0].out, jobs)
    jobs[0].out.mkdir(parents=True, exist_ok=True)
    context = multiprocessing.get_context('spawn')
    asked = context.Event()
    workers = min(len(os.sched_getaffinity(0)), len(jobs))
    total = sum(job.scenario.duration for job in jobs)
    with (
        ProcessPoolExecutor(workers, context, _prepare_worker, (asked,)) as pool,
        tqdm(
            total=total, unit=' s', bar_format=_BAR, unit_scale=True, disable=None if bar else True
        ) as progress,
    ):
        futures: dict[Future[bool], Job] = {}
        for job in sorted(jobs, key=lambda job: -job.scenario.duration):
            path = job.out / f'{job.scenario.name.replace("/", "_")}.{extension}'
            futures[pool.submit(_run_in_worker, replace(job, out=path))] = job
        pending = set(futures)
        whole = True
        while pending:
            if stop.is_set() and not asked.is_set():
                asked.set()
                for future in pending:
                    future.cancel()
            done, pending = wait(pending, timeout=0.2, return_when=FIRST_COMPLETED)
            for future in done:
                if future.cancelled():
                    whole = False
                    continue
                whole = future.result() and whole
                progress.update(futures[future].scenario.duration)
    return whole


def _thinned(columns: Mapping[str, np.ndarray], first: int, every: int) -> dict[str, np.ndarray]:
    return {name: column[first::every] for name, column in columns.items()}


def _check_space(path: Path, jobs: Sequence[Job]) -> None:
    samples = sum(job.simulator().samples for job in jobs)
    wanted = samples * BYTES_PER_SAMPLE
    existing = next(p for p in (path.absolute(), *path.absolute().parents) if p.exists())
    free = shutil.disk_usage(existing).free
    if wanted > free:
        raise OSError(
            f'--out: {samples} samples need about {wanted / 1e9:.0f} GB, '
            f'{existing} has {free / 1e9:.0f} GB; lower --rate'
        )


_asked: Stop


def _prepare_worker(asked: Stop) -> None:
    global _asked
    _asked = asked
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides, and sets the event


def _run_in_worker(job: Job) -> bool:
    return run_one(job, _asked)
