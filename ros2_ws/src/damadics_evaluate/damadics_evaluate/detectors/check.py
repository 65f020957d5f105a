# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The test that any detector must pass: finite, one value per sample, the same again, causal."""

from collections.abc import Iterator

import numpy as np

from damadics_evaluate.columns import Floats
from damadics_evaluate.detectors.base import CV, Detector, F, MissingPackageError, X
from damadics_evaluate.detectors.own import RefusedError
from damadics_evaluate.loading import told

CUTS = (0.55, 0.8, 0.97)  # of the record, where the end is cut off
TOLERANCE = 1e-6
BEYOND = (-3.0, 4.0)


def problems(kind: type[Detector], hour: Floats, run: Floats, strict: bool = True) -> list[str]:
    """
    Return what a detector does that no detector may.

    :param kind: class of the detector.
    :param hour: fault-free rows to learn from.
    :param run: rows with a fault in their second half.
    :param strict: also judge a record whose flow is not measured.
    :return: one sentence each, with its name; empty where it passes.
    :raises MissingPackageError: where a library that it needs is not installed.
    """
    try:
        return list(_problems(kind, hour, run, strict))
    except MissingPackageError:
        raise
    except RefusedError as error:
        return [str(error)]
    except (Exception, SystemExit) as error:
        # the point of the check: whatever it raises is told under its name
        return [f'{kind.name} raises: {told(error)}']


def refuse(kind: type[Detector], hour: Floats, run: Floats) -> None:
    """
    Refuse a detector that must not take part.

    :raises RefusedError: naming it and all it does.
    """
    found = problems(kind, hour, run, strict=False)
    if found:
        raise RefusedError('; '.join(found))


def _problems(kind: type[Detector], hour: Floats, run: Floats, strict: bool) -> Iterator[str]:
    detector = kind()
    detector.fit(hour.copy())
    given = run.copy()
    first = _judged(detector, given)
    yield from _shape(kind.name, first, run)
    if not np.array_equal(given, run, equal_nan=True):
        yield f'{kind.name} changes the samples it is given'
    if first.shape != (len(run),) or np.isnan(first).any():
        return
    _judged(detector, hour[: len(hour) // 2].copy())
    if not _same(first, _judged(detector, run.copy())):
        yield f'{kind.name} judges a record otherwise after another one: it remembers'
    again = kind()
    again.fit(hour.copy())
    if not _same(first, _judged(again, run.copy())):
        yield f'{kind.name} is not the same twice: give its random numbers a seed'
    ahead = looks_ahead(detector, run, first)
    if ahead:
        yield ahead
    if strict:
        blind = run.copy()
        blind[:, F] = np.nan
        yield from _shape(f'{kind.name}, flow not measured,', _judged(detector, blind), run)


def looks_ahead(detector: Detector, run: Floats, judged: Floats) -> str:
    """
    Run a fitted detector again with the end cut off, and with another end.

    :param detector: fitted.
    :param run: rows.
    :param judged: its statistic on them.
    :return: what it does, empty where its past does not depend on the future.
    """
    for share in CUTS:
        n = int(share * len(run))
        if not _same(judged[:n], _judged(detector, run[:n].copy())):
            return (
                f'{detector.name} looks ahead: without the samples after {n} it judges otherwise'
            )
        other = run.copy()
        other[n:, CV], other[n:, X] = BEYOND  # further apart than in any record
        if not _same(judged[:n], _judged(detector, other)[:n]):
            return f'{detector.name} looks ahead: other samples after {n} change its past'
    return ''


def _judged(detector: Detector, rows: Floats) -> Floats:
    return np.asarray(detector.statistic(rows), dtype=np.float64)


def _shape(name: str, values: Floats, run: Floats) -> Iterator[str]:
    if values.shape != (len(run),):
        yield f'{name} returns shape {values.shape} for {len(run)} samples'
    elif np.isnan(values).any():
        yield f'{name} returns NaN, first at sample {int(np.flatnonzero(np.isnan(values))[0])}'


def _same(a: Floats, b: Floats) -> bool:
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=TOLERANCE, atol=TOLERANCE))
