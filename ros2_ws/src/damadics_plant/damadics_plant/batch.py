# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Many runs over all cores."""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import Any, TypeVar, overload

from damadics_plant.run import Run
from damadics_plant.simulator import simulate

Job = Mapping[str, Any]  # arguments of `simulate`
T = TypeVar('T')


@overload
def simulate_many(jobs: Iterable[Job], *, workers: int | None = None) -> Iterator[Run]: ...


@overload
def simulate_many(
    jobs: Iterable[Job], reduce: Callable[[Run], T], workers: int | None = None
) -> Iterator[T]: ...


def simulate_many(
    jobs: Iterable[Job],
    reduce: Callable[[Run], T] | None = None,
    workers: int | None = None,
) -> Iterator[Run | T]:
    """
    Run many scenarios, models or seeds in threads; the compiled loops run side by side.

    :param jobs: arguments of `simulate` for each run, may be endless.
    :param reduce: applied to each run in its worker, for instance to keep its last sample only.
    :param workers: number of threads, None: one per core.
    :return: runs, or what `reduce` made of them, in the order of the jobs; at most two per worker
        are in memory at a time.
    :raises ValueError: as `simulate`.

    >>> jobs = ({'scenario': 'random_nominal', 'seed': seed, 'duration': 9} for seed in range(3))
    >>> [round(x, 3) for x in simulate_many(jobs, lambda run: float(run.x1[-1]))]
    [0.542, 0.506, 0.36]
    """
    workers = workers or len(os.sched_getaffinity(0))
    todo = iter(jobs)

    def work(job: Job) -> Run | T:
        run = simulate(**job)
        return reduce(run) if reduce else run

    with ThreadPoolExecutor(workers) as pool:
        running: deque[Future[Run | T]] = deque(
            pool.submit(work, job) for job in islice(todo, 2 * workers)
        )
        try:
            while running:
                result = running.popleft().result()
                running.extend(pool.submit(work, job) for job in islice(todo, 1))
                yield result
        finally:
            for future in running:
                future.cancel()
