# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Classifiers on windows: features, naming, the cache of what was learned."""

import numpy as np
import pytest
from damadics_evaluate.baselines import classifiers
from damadics_evaluate.baselines.classifiers import Forest, Network, train
from damadics_evaluate.baselines.windows import STEP, WINDOW, Features
from damadics_evaluate.scenarios.trajectories import CACHE_VARIABLE

FAULTS = (0, 13, 16)


def record(n, seed, fault=0, start=None):
    """A made-up valve; 13: the position reads high, 16: it follows slowly."""
    rng = np.random.default_rng(seed)
    t = np.arange(float(n))
    cv = 0.5 + 0.2 * np.sin(t / 12.0)
    x = cv.copy()
    late = t >= (n if start is None else start)
    if fault == 13:
        x[late] = 1.2 * cv[late]
    if fault == 16:
        x[late] = 0.5 + 0.1 * np.sin((t[late] - 6.0) / 12.0)
    flow = 0.9 - 0.5 * cv
    signals = np.column_stack((x, np.full(n, 0.9), np.full(n, 0.6), np.full(n, 0.2), flow))
    return np.column_stack((t, cv, signals + rng.normal(0.0, 0.002, signals.shape)))


@pytest.fixture
def lessons(monkeypatch, tmp_path):
    """Let the classifiers learn from the made-up valve; count how often they do."""
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    calls = []

    def made_up():
        calls.append(1)
        parts = [
            Features(record(900, 50 + s)).of(record(900, s, fault, 0))
            for fault in FAULTS
            for s in range(3)
        ]
        labels = np.repeat(FAULTS, 3 * len(parts[0]))
        return np.concatenate(parts), labels

    monkeypatch.setattr(classifiers, '_lessons', made_up)
    classifiers._model.cache_clear()
    yield calls
    classifiers._model.cache_clear()


def test_a_window_is_judged_when_it_is_full():
    features = Features(record(900, 1))
    rows = features.of(record(300, 2))
    assert len(rows) == (300 - WINDOW) // STEP + 1
    assert len(features.of(record(WINDOW - 1, 2))) == 0
    assert np.abs(rows).max() < 20.0
    bad = features.of(record(300, 2, 13, 0))
    assert np.abs(bad).max() > 3.0 * np.abs(rows).max()


@pytest.mark.parametrize('kind', [Forest, Network])
def test_faults_are_found_and_named(kind, lessons):
    detector = kind()
    detector.t_on = 0.0
    detector.fit(record(900, 7))
    for fault in FAULTS[1:]:
        run = record(900, 8, fault, 500)
        statistic = detector.statistic(run)
        assert statistic[600:].min() > 1.5 * statistic[:500].max()
        found = detector.isolate_at(run, 510.0, [515.0, 600.0, 899.0])
        assert [d.ranking[0][0] for d in found][-1] == fault
        assert detector.cause(run, 510.0).split(' or ')[0] == f'f{fault}'
    assert len(lessons) == 1


def test_what_was_learned_is_kept(lessons):
    told = []
    train(told.append, ['forest'])
    assert len(told) == 1
    classifiers._model.cache_clear()
    train(told.append, ['forest', 'scada'])
    Forest().model()
    assert len(told) == len(lessons) == 1
