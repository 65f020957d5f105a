# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
import math
import os

import numpy as np
import pytest
from damadics_fd.store.trend_fit import fit_line, fit_recent
from damadics_fd.store.trends import TrendFile

DAY = 86400.0
STD = (0.001, 2.0, 0.02)


def series(rng, n, slope, sigma, scatter=1.0):
    t = np.arange(n) * 900.0
    return t, slope * t + sigma * scatter * rng.standard_normal(n), np.full(n, sigma)


@pytest.mark.plain
def test_line_agrees_with_polyfit():
    rng = np.random.default_rng(0)
    t, y, s = series(rng, 50, 1e-6, 0.02)
    s = s * rng.uniform(0.5, 2.0, 50)
    line = fit_line(t, y, s)
    slope, level = np.polyfit(t - line.origin, y, 1, w=1.0 / s)
    assert line.slope == pytest.approx(slope) and line.level == pytest.approx(level)


@pytest.mark.plain
def test_band_and_time_to_limit_cover_the_truth():
    """90 % intervals hold the true line and the true time in about 90 % of 400 series."""
    rng = np.random.default_rng(1)
    slope, limit, band, time = 2e-6, 0.5, 0, 0
    for _ in range(400):
        t, y, s = series(rng, 100, slope, 0.02)
        line = fit_line(t, y, s)
        now = t[-1]
        value, std = line.at(now)
        band += abs(value - slope * now) < 1.645 * std
        left = line.time_to(limit, now)
        assert left.earliest <= left.expected <= left.latest
        time += left.earliest <= limit / slope - now <= left.latest
    assert 340 <= band <= 384 and 340 <= time <= 384


@pytest.mark.plain
def test_scatter_beyond_the_stated_deviations_widens_the_band():
    rng = np.random.default_rng(2)
    calm = fit_line(*series(rng, 100, 0.0, 0.02))
    rough = fit_line(*series(rng, 100, 0.0, 0.02, scatter=5.0))
    assert rough.at(1e5)[1] > 3.0 * calm.at(1e5)[1]


@pytest.mark.plain
def test_a_flat_or_leaving_trend_never_meets_its_limit():
    line = fit_line(np.arange(10.0), -0.01 * np.arange(10.0), np.full(10, 1e-4))
    assert line.time_to(0.5, 10.0).expected == math.inf
    assert line.time_to(0.5, 10.0).latest == math.inf
    assert line.time_to(-0.05, 10.0).expected == 0.0


@pytest.mark.plain
def test_trend_forgets_what_was_before_a_repair():
    rng = np.random.default_rng(3)
    t, y, s = series(rng, 400, 3e-6, 0.01)
    y[300:] = 1e-7 * (t[300:] - t[300]) + 0.01 * rng.standard_normal(100)
    line = fit_recent(t, y, s)
    assert line.points <= 100 and abs(line.slope) < 1e-6


def test_points_survive_a_restart_and_name_the_time_to_limit(tmp_path):
    rng = np.random.default_rng(4)
    first = TrendFile(tmp_path / 'new', 'LV-101', 'abc')
    for k in range(60):
        change = (-0.02 * k / 60 + 0.001 * rng.standard_normal(), 0.0, 0.0)
        assert first.add(int(k * 3600e9), change, STD)
    assert not first.add(int(59.1 * 3600e9), (0.0, 0.0, 0.0), STD), 'too early'
    again = TrendFile(tmp_path / 'new', 'LV-101', 'abc')
    np.testing.assert_allclose(again.points('spring')[1], first.points('spring')[1], atol=1e-5)
    outlook = {o.quantity: o for o in again.outlook({'spring': [-0.1, 0.1]}, 59 * 3600.0)}
    spring = outlook['spring']
    assert spring.limit == -0.1
    assert spring.time.earliest < 10 * DAY < spring.time.latest + DAY
    assert 'limit -0.1 in' in spring.sentence() and 'days' in spring.sentence()


def test_a_cut_line_is_skipped_and_the_next_point_is_whole(tmp_path):
    file = TrendFile(tmp_path, 'V', 'r')
    for k in range(3):
        file.add(k * 10**12, (0.1, 0.2, 0.3), STD)
    text = file.path.read_text()
    for cut in range(len(text.splitlines(keepends=True)[0]), len(text)):
        file.path.write_text(text[:cut])
        again = TrendFile(tmp_path, 'V', 'r')
        assert again.unreadable <= 1
        assert again.add(10**13, (0.5, 0.5, 0.5), STD)
        assert TrendFile(tmp_path, 'V', 'r').points('spring')[1][-1] == 0.5


def test_series_of_another_reference_or_a_clock_set_back_is_left_out(tmp_path):
    old = TrendFile(tmp_path, 'V', 'old')
    old.add(10**12, (0.1, 0.1, 0.1), STD)
    new = TrendFile(tmp_path, 'V', 'new')
    assert len(new.points('spring')[0]) == 0
    new.add(5 * 10**12, (0.2, 0.1, 0.1), STD)
    assert new.add(10**12, (0.3, 0.1, 0.1), STD), 'an earlier stamp starts a new series'
    assert list(TrendFile(tmp_path, 'V', 'new').points('spring')[1]) == [0.3]


def test_bad_points_and_names_are_refused(tmp_path):
    file = TrendFile(tmp_path, 'V', 'r')
    assert not file.add(0, (math.nan, 0.0, 0.0), STD)
    assert not file.path.exists()
    assert TrendFile(tmp_path, '../V/1', 'r').path.parent == tmp_path
    with pytest.raises(ValueError, match='comma'):
        TrendFile(tmp_path, 'V', 'a,b')


BAD = ['nan', 'inf', '-inf', '1e308', '0', '-1', '', 'x', '1e999', '5' * 5000]


@pytest.mark.parametrize('bad', BAD)
@pytest.mark.parametrize('column', ['stamp', 'value', 'std', 'all'])
def test_a_line_that_was_never_written_is_skipped_and_counted(tmp_path, column, bad):
    file = TrendFile(tmp_path, 'V', 'r')
    for k in range(20):
        file.add(k * 10**12, (0.1 + 1e-3 * k, 0.2, 0.3), STD)
    words = ['21000000000000', '0.1', '0.001', '0.2', '2', '0.3', '0.02', 'r']
    for n in {'stamp': [0], 'value': [1], 'std': [2, 4], 'all': range(7)}[column]:
        words[n] = bad
    with file.path.open('a') as stream:
        stream.write(','.join(words) + '\n')
    again = TrendFile(tmp_path, 'V', 'r')
    outlook = again.outlook({'spring': [-0.1, 0.5]}, 20e3)
    assert all(math.isfinite(o.value) for o in outlook)
    allowed = (column, bad) in {('value', '0'), ('value', '-1'), ('stamp', '0'), ('stamp', '-1')}
    assert again.unreadable == (0 if allowed else 1)


def test_a_changed_digit_is_noticed(tmp_path):
    file = TrendFile(tmp_path, 'V', 'r')
    file.add(10**12, (0.1, 0.2, 0.3), STD)
    file.path.write_text(file.path.read_text().replace('0.2', '0.9'))
    again = TrendFile(tmp_path, 'V', 'r')
    assert (again.unreadable, len(again.points('spring')[0])) == (1, 0)


def test_a_file_of_0_1_is_read(tmp_path):
    file = TrendFile(tmp_path, 'V', 'r')
    file.path.write_text(
        'stamp_ns,spring,spring_std,preload,preload_std,friction,friction_std,reference\n'
        '1000000000000,0.1,0.001,0.2,2,0.3,0.02,r\n'
    )
    again = TrendFile(tmp_path, 'V', 'r')
    assert list(again.points('friction')[1]) == [0.3]
    assert again.add(2 * 10**12, (0.1, 0.2, 0.3), STD)
    assert len(TrendFile(tmp_path, 'V', 'r').points('friction')[1]) == 2


@pytest.mark.parametrize('kind', ['folder', 'garbage', 'pipe', 'loop', 'null'])
def test_what_is_no_file_of_trends_is_moved_aside(tmp_path, kind):
    path = tmp_path / 'V.trend.csv'
    make = {
        'folder': path.mkdir,
        'garbage': lambda: path.write_bytes(bytes(range(256)) * 10),
        'pipe': lambda: os.mkfifo(path),
        'loop': lambda: path.symlink_to(path),
        'null': lambda: path.symlink_to('/dev/null'),
    }
    make[kind]()
    file = TrendFile(tmp_path, 'V', 'r')
    assert file.unreadable == 1
    assert file.add(10**12, (0.1, 0.2, 0.3), STD)
    assert len(list(tmp_path.glob('V.trend.csv.bad-*'))) == 1
