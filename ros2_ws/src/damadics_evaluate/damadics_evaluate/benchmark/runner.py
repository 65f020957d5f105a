# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Run a campaign over local processes or a Dask cluster, with progress bar and resume."""

import json
import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TextIO

from damadics_fd.commands.cluster import cluster
from damadics_fd.start import one_thread

from damadics_evaluate.baselines import DETECTORS
from damadics_evaluate.benchmark.campaign import (
    CALIBRATION_SEED,
    NOMINAL_SEED,
    Campaign,
    versions,
)
from damadics_evaluate.benchmark.results import Limits, Result
from damadics_evaluate.benchmark.units import limits, nominal_unit, scenario_unit
from damadics_evaluate.detectors.check import refuse
from damadics_evaluate.detectors.find import find_detector
from damadics_evaluate.detectors.own import RefusedError
from damadics_evaluate.scenarios.cases import case
from damadics_evaluate.scenarios.trajectories import learning_hour, scenario_run

RESULTS = 'results.jsonl'
MANIFEST = 'campaign.json'
CHECKED_ON = 'f11_B'  # the run on which detectors of one's own are checked
Key = tuple[str, int, str]  # scenario, seed, detector
Unit = tuple[Callable[..., list[Result]], tuple[Campaign | Limits | str | int, ...]]


def read_results(directory: Path) -> list[Result]:
    """
    Return the results of a campaign directory; a torn last line of a killed run is dropped.

    Where a detector was run again with other settings, its newest results count.

    :param directory: as given to `run_campaign`.
    :raises FileNotFoundError: where it holds no results.
    """
    file = directory / RESULTS
    if not file.exists():
        raise FileNotFoundError(f'{directory} holds no {RESULTS}: make it with evaluate run')
    results = []
    for line in file.read_text(encoding='utf-8').splitlines():
        try:
            results.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    newest = {r['detector']: r['settings_hash'] for r in results}
    return [r for r in results if r['settings_hash'] == newest[r['detector']]]


def run_campaign(
    campaign: Campaign,
    directory: Path,
    jobs: int | None = None,
    scheduler: str | None = None,
    refused: Sequence[str] = (),
) -> list[Result]:
    """
    Run what is missing of a campaign and return all its results.

    :param campaign: what to run.
    :param directory: where results go; results already there with the same settings are kept.
    :param jobs: local processes, by default one per core.
    :param scheduler: address of a Dask scheduler, such as tcp://host:8786, instead of processes.
    :param refused: why detectors were left out; kept for the report.
    """
    directory.mkdir(parents=True, exist_ok=True)
    _write_manifest(campaign, directory, refused)
    earlier = read_results(directory) if (directory / RESULTS).exists() else []
    hashes = {name: campaign.settings_hash(name) for name in campaign.detectors}
    kept = [r for r in earlier if hashes.get(r['detector']) == r['settings_hash']]
    done = {_key(r) for r in kept}
    with _executor(jobs, scheduler) as executor:
        kept += _collect(executor, directory, _nominal_units(campaign, done), 'fault-free days')
        limit = limits(campaign, [r for r in kept if r['kind'] == 'nominal'])
        kept += _collect(executor, directory, _scenario_units(campaign, limit, done), 'scenarios')
    return kept


def admit(campaign: Campaign, tell: Callable[[str], None]) -> tuple[Campaign, list[str]]:
    """
    Check the detectors that are not built in, and leave out those that must not take part.

    :param campaign: as stated.
    :param tell: told of every detector that is refused, and why.
    :return: the campaign with the others, and why each of the rest was refused.
    :raises ValueError: where none is left.
    """
    kept: list[str] = []
    refused: list[str] = []
    for name in campaign.detectors:
        if name not in DETECTORS:
            try:
                refuse(find_detector(name), learning_hour(0), scenario_run(CHECKED_ON, 0)[0])
            except RefusedError as error:
                tell(f'refused: {error}')
                refused.append(str(error))
                continue
        kept.append(name)
    if not kept:
        raise ValueError('no detector is left: mend them, evaluate check DETECTOR tells how')
    return replace(campaign, detectors=tuple(kept)), refused


def _write_manifest(campaign: Campaign, directory: Path, refused: Sequence[str]) -> None:
    """Write what was run here, all calls together."""
    file = directory / MANIFEST
    stated = asdict(campaign)
    if file.exists():
        earlier = json.loads(file.read_text(encoding='utf-8'))['campaign']
        for name in ('scenarios', 'detectors', 'seeds'):
            stated[name] = list(dict.fromkeys((*earlier[name], *stated[name])))
        for name in ('nominal_days', 'isolated_seeds'):
            stated[name] = max(earlier[name], stated[name])
    manifest = {'campaign': stated, 'refused': list(refused), 'versions': versions()}
    file.write_text(json.dumps(manifest, indent=2), encoding='utf-8')


def _key(result: Result) -> Key:
    return result.get('scenario', 'nominal'), result['seed'], result['detector']


def _missing(campaign: Campaign, name: str, seed: int, done: set[Key]) -> Campaign:
    """Return the campaign with those detectors that have no result of this unit yet."""
    left = tuple(d for d in campaign.detectors if (name, seed, d) not in done)
    return replace(campaign, detectors=left)


def _nominal_units(campaign: Campaign, done: set[Key]) -> Iterator[Unit]:
    for seed in range(CALIBRATION_SEED, CALIBRATION_SEED + campaign.calibration_days):
        part = _missing(campaign, 'nominal', seed, done)
        part = replace(
            part, detectors=tuple(d for d in part.detectors if find_detector(d).calibrated)
        )
        if part.detectors:
            yield nominal_unit, (part, seed)
    for seed in range(NOMINAL_SEED, NOMINAL_SEED + campaign.nominal_days):
        part = _missing(campaign, 'nominal', seed, done)
        if part.detectors:
            yield nominal_unit, (part, seed)


def _scenario_units(campaign: Campaign, limit: Limits, done: set[Key]) -> Iterator[Unit]:
    by_length = sorted(campaign.scenarios, key=lambda name: -case(name).duration)
    for name in by_length:  # the longest first, so that no core waits at the end
        for seed in campaign.seeds:
            part = _missing(campaign, name, seed, done)
            if part.detectors:
                yield scenario_unit, (part, limit, name, seed)


def _collect(
    executor: Executor, directory: Path, units: Iterable[Unit], what: str
) -> list[Result]:
    """Run the units, writing each result as soon as it is there."""
    from tqdm import tqdm

    futures = [executor.submit(function, *arguments) for function, arguments in units]
    results = []
    with (
        _appending(directory / RESULTS) as stream,
        tqdm(total=len(futures), desc=what, unit='run', disable=not futures) as bar,
    ):
        try:
            for future in as_completed(futures):
                for result in future.result():
                    results.append({**result, 'versions': versions()})
                    stream.write(json.dumps(results[-1]) + '\n')
                stream.flush()
                bar.update()
        except BaseException:
            for future in futures:
                future.cancel()
            raise
    return results


def _appending(file: Path) -> TextIO:
    """Open the results to add to them; what a kill has torn stays a line of its own."""
    stream = file.open('a', encoding='utf-8')
    if file.stat().st_size and not file.read_bytes().endswith(b'\n'):
        stream.write('\n')
    return stream


@contextmanager
def _executor(jobs: int | None, scheduler: str | None) -> Iterator[Executor]:
    if scheduler is None:
        one_thread()
        context = multiprocessing.get_context('spawn')
        with ProcessPoolExecutor(jobs or os.cpu_count(), mp_context=context) as pool:
            yield pool
        return
    with cluster(scheduler) as executor:
        yield executor
