# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
import math
import time

import numpy as np
import pytest
from damadics_fd.store.intervals import DAY, LEVELS, Intervals


@pytest.fixture
def store(tmp_path):
    intervals = Intervals(tmp_path / 'trends.sqlite')
    yield intervals
    intervals.close()


def test_an_hour_has_least_mean_and_greatest_of_its_points(store):
    for k, value in enumerate([1.0, 4.0, 1.0, 2.0]):
        store.add('v', 900.0 * k, {'friction': value}, {'friction': 0.1})
    quarter = store.series('v', 'friction', 0.0, 3600.0)
    assert quarter.length == 900.0 and quarter.mean.tolist() == [1.0, 4.0, 1.0, 2.0]
    store.forget(now=90 * DAY + 1e5)
    hour = store.series('v', 'friction', 0.0, 1e9)
    assert (hour.least[0], hour.mean[0], hour.greatest[0]) == (1.0, 2.0, 4.0)
    assert hour.std[0] == pytest.approx(0.1)
    assert len(store.series('v', 'spring', 0.0, 1e9).start) == 0
    assert len(store.series('other', 'friction', 0.0, 1e9).start) == 0


def test_values_that_are_not_finite_do_not_spoil_an_interval(store):
    store.add('v', 10.0, {'friction': math.nan, 'spring': 1.0})
    store.add('v', 20.0, {'friction': 3.0, 'spring': math.inf})
    store.add('v', math.nan, {'friction': 9.0})
    store.add('v', 30.0, {})
    assert store.series('v', 'friction', 0.0, 99.0).mean.tolist() == [3.0]
    assert store.series('v', 'spring', 0.0, 99.0).mean.tolist() == [1.0]


def test_a_new_reference_begins_its_intervals_anew(store):
    store.add('v', 10.0, {'friction': 3.0}, reference='a')
    store.add('v', 20.0, {'friction': 0.0}, reference='b')
    found = store.series('v', 'friction', 0.0, 99.0)
    assert (found.mean.tolist(), found.reference) == ([0.0], ['b'])


def test_long_ranges_take_longer_intervals_and_lose_no_extreme(store):
    rng = np.random.default_rng(0)
    values = rng.normal(size=400)
    for k, value in enumerate(values):
        store.add('v', k * 0.5 * DAY, {'friction': float(value)})
    whole = store.series('v', 'friction', 0.0, 1e9)
    assert whole.length == LEVELS[-1] and len(whole.start) == 200
    assert whole.greatest.max() == pytest.approx(values.max(), abs=1e-6)
    assert whole.least.min() == pytest.approx(values.min(), abs=1e-6)
    short = store.series('v', 'friction', 10 * DAY, 20 * DAY)
    assert short.length == LEVELS[0]


def test_ten_years_of_a_valve_are_small_and_open_fast(store, tmp_path):
    """Rows as retention leaves them after ten years; a hundred valves must stay below 1 GB."""
    years, now = 10 * 365 * DAY, 20 * 365 * DAY
    data = np.full((9, 4), 0.5, np.float32).tobytes()
    store.add('v', now - years, {'friction': 0.5})
    for level, kept in zip(LEVELS, (90 * DAY, 730 * DAY, years), strict=True):
        rows = [(1, start, 4, 1, data) for start in range(now - kept, now, level)]
        with store._db:
            store._db.executemany(
                f'INSERT OR REPLACE INTO point_{level} VALUES (?, ?, ?, ?, ?)', rows
            )
    store._db.execute('PRAGMA wal_checkpoint(TRUNCATE)')
    size = (tmp_path / 'trends.sqlite').stat().st_size
    print(f'{size / 1e6:.2f} MB for ten years of a valve')
    assert 100 * size < 1e9
    slowest = 0.0
    for days in (1, 30, 90, 365, 3650):
        began = time.perf_counter()
        found = store.series('v', 'friction', now - days * DAY, now)
        slowest = max(slowest, time.perf_counter() - began)
        assert 90 <= len(found.start) <= 9000
    print(f'slowest range: {1e3 * slowest:.0f} ms')
    assert slowest < 0.5
