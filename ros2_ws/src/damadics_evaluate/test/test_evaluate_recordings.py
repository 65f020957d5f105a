# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Labelled recordings: labels, files of several kinds, indices and their intervals."""

import csv
import json
import math

import numpy as np
import pytest
from damadics_evaluate import main
from damadics_evaluate.recordings.files import thinned
from damadics_evaluate.recordings.intervals import (
    median_interval,
    rate_interval,
    share_interval,
)
from damadics_evaluate.recordings.labels import read_labels
from damadics_fd.commands.replay.replay import main as replay
from damadics_plant import simulate
from damadics_plant.writer import open_writer

HEADER = 'recording,kind,start,end,fault\n'


def valve(n, faults=(), seed=0, start=0.0):
    """Columns in SI of a valve that holds still during its faults."""
    rng = np.random.default_rng(seed)
    t = np.arange(n, dtype=float)
    cv = 0.5 + 0.2 * np.sin(t / 15.0)
    x = cv + rng.normal(0.0, 0.003, n)
    for first, last in faults:
        x[first:last] = x[first]
    return {
        't': t + start,
        'cv': cv,
        'x1': x,
        'p1': np.full(n, 3.5e6) + rng.normal(0.0, 3e3, n),
        'p2': np.full(n, 2.6e6) + rng.normal(0.0, 3e3, n),
    }


def write_csv(file, columns):
    table = np.column_stack(list(columns.values()))
    np.savetxt(file, table, delimiter=',', header=','.join(columns), comments='', fmt='%.10g')


def run(tmp_path, labels, *arguments):
    file = tmp_path / 'labels.csv'
    file.write_text(HEADER + labels)
    target = tmp_path / 'out.csv'
    assert main(['recordings', str(file), *map(str, arguments), '--csv', str(target)]) == 0
    with target.open() as stream:
        return list(csv.DictReader(stream))


def test_two_recordings_one_to_learn_from(tmp_path, capsys):
    write_csv(tmp_path / 'good.csv', valve(1500, seed=1))
    write_csv(tmp_path / 'bad.csv', valve(2000, [(1000, 1100), (1500, 1560)], seed=2, start=5000))
    labels = 'good.csv,learn,0,1500,\nbad.csv,fault,1000,1100,f4\nbad.csv,fault,1500,1560,f4\n'
    rows = run(
        tmp_path, labels, tmp_path / 'good.csv', tmp_path / 'bad.csv', '--detectors', 'fixed'
    )
    assert len(rows) == 2
    assert all(0 <= float(r['t_dt']) <= 30 for r in rows)
    assert all(float(r['r_fd']) < 0.05 for r in rows)
    assert all(float(r['r_td']) > 0.5 for r in rows)
    out = capsys.readouterr().out
    assert '2/2 [0.34, 1.00]' in out
    assert 'names none' in out


def test_a_detector_that_is_refused_does_not_stop_the_others(tmp_path, capsys):
    bad = tmp_path / 'bad.py'
    bad.write_text(
        'class Bad:\n'
        '    def fit(self, columns): pass\n'
        '    def statistic(self, columns): return columns["x1"] * float("nan")\n'
    )
    write_csv(tmp_path / 'a.csv', valve(1500, [(1200, 1300)]))
    labels = 'a.csv,learn,0,900,\na.csv,fault,1200,1300,f4\n'
    rows = run(tmp_path, labels, tmp_path / 'a.csv', '--detectors', f'{bad}:Bad', 'fir_cusum')
    assert [r['detector'] for r in rows] == ['fir_cusum']
    assert 'Bad returns NaN' in capsys.readouterr().out


def test_parquet_and_dates(tmp_path):
    pyarrow = pytest.importorskip('pyarrow')
    from pyarrow import parquet

    start = 1_006_000_000
    columns = valve(1500, [(1200, 1300)], start=start)
    columns['POS'] = 100.0 * columns.pop('x1')
    parquet.write_table(pyarrow.table(columns), tmp_path / 'a.parquet')
    labels = (
        'a.parquet,learn,2001-11-17T12:26:40Z,2001-11-17T12:41:40Z,\n'
        'a.parquet,fault,2001-11-17T12:46:40Z,2001-11-17T12:48:20Z,f4\n'
    )
    rows = run(
        tmp_path, labels, tmp_path / 'a.parquet', '--map', 'x1=POS*0.01', '--detectors', 'fixed'
    )
    assert 0 <= float(rows[0]['t_dt']) <= 30


def test_a_cluster_takes_a_folder_of_many_valves(tmp_path, capsys):
    """Replay and evaluation give there what they give here, a file of many valves included."""
    distributed = pytest.importorskip('distributed')
    pyarrow = pytest.importorskip('pyarrow')
    from pyarrow import parquet

    folder = tmp_path / 'month'
    folder.mkdir()
    write_csv(folder / 'own.csv', valve(1500, [(1200, 1300)], seed=5))
    some = [valve(1500, [(1200, 1300)], seed=1), valve(1500, [(1300, 1400)], seed=2)]
    table = {name: np.concatenate([one[name] for one in some]) for name in some[0]}
    table['valve'] = np.repeat(['/lv1', '/lv2'], 1500)
    parquet.write_table(pyarrow.table(table), folder / 'two.parquet')
    labels = (
        'two.parquet,learn,0,900,\nown.csv,learn,0,900,\ntwo.parquet#/lv1,fault,1200,1300,f4\n'
        'two.parquet#/lv2,fault,1300,1400,f4\nown.csv,fault,1200,1300,f4\n'
    )
    here, there = tmp_path / 'here.json', tmp_path / 'there.json'
    words = [str(folder), '--mode', 'paper', '--set', 'sample_rate=1.0', '--jobs', '1']
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True
    ) as cluster:
        address = ['--scheduler', cluster.scheduler_address]
        assert replay([*words, '--out', str(there), *address]) == 0
        rows = run(tmp_path, labels, folder, '--detectors', 'fixed', *address)
    assert replay([*words, '--out', str(here)]) == 0
    speeds = 'samples_per_s'
    found, wanted = (
        [{k: v for k, v in one.items() if k != speeds} for one in json.loads(file.read_text())]
        for file in (there, here)
    )
    assert found == wanted
    assert [one['bag'].rpartition('/')[2] for one in found] == ['own.csv', 'lv1', 'lv2']
    assert [one['samples'] for one in found] == [1500] * 3
    assert rows == run(tmp_path, labels, folder, '--detectors', 'fixed')
    assert len(rows) == 3 and all(0 <= float(row['t_dt']) <= 30 for row in rows)
    assert replay([*words, '--scheduler', 'tcp://127.0.0.1:9']) == 1
    assert 'tcp://127.0.0.1:9' in capsys.readouterr().err


def test_bags_are_read(tmp_path):
    columns = dict(simulate('f11@0.9', rate=1.0, noise=True, duration=1200.0))
    with open_writer(tmp_path / 'run.mcap') as write:
        write(columns)
    rows = run(
        tmp_path,
        'run.mcap,learn,100,800,\nrun.mcap,fault,900,1200,f11\n',
        tmp_path / 'run.mcap',
        *('--detectors', 'narx'),
    )
    assert 0 <= float(rows[0]['t_dt']) <= 5


@pytest.mark.parametrize(
    ('labels', 'said'),
    [
        ('a.csv,lern,0,9,\n', "kind 'lern' is not one of learn, free, fault"),
        ('a.csv,learn,9,3,\n', 'ends at 3, before it starts at 9'),
        ('a.csv,fault,0,9,\n', 'names no fault'),
        ('a.csv,learn,soon,9,\n', "'soon' is neither seconds nor a date"),
        ('a.csv,fault,0,9,f4\n', 'no stretch to learn from'),
        ('b.csv,learn,0,900,\n', 'labels name b.csv, which is not among the recordings'),
    ],
)
def test_wrong_labels_are_told(tmp_path, capsys, labels, said):
    write_csv(tmp_path / 'a.csv', valve(1000))
    file = tmp_path / 'labels.csv'
    file.write_text(HEADER + labels)
    command = ['recordings', str(file), str(tmp_path / 'a.csv'), '--detectors', 'fixed']
    assert main(command) == 1
    assert said in capsys.readouterr().err


def test_a_file_that_is_no_file_of_labels_is_told_how_one_begins(tmp_path):
    file = tmp_path / 'labels.csv'
    file.write_text('a,b\n1,2\n')
    with pytest.raises(ValueError, match='recording,kind,start,end,fault'):
        read_labels(file)


def test_fast_recordings_are_thinned_and_put_in_order():
    stamp = (np.arange(1000) * 5_000_000)[::-1]
    columns = {'stamp': stamp, 'cv': np.arange(1000.0)[::-1]}
    slow = thinned(columns, 1.0)
    assert slow['cv'].tolist() == [0.0, 200.0, 400.0, 600.0, 800.0]
    hour = {'stamp': np.arange(100) * 60_000_000_000, 'cv': np.zeros(100)}
    assert len(thinned(hour, 1.0)['cv']) == 100


def test_intervals_cover_what_they_promise():
    rng = np.random.default_rng(3)
    covered = {'share': 0, 'rate': 0, 'median': 0}
    for _ in range(600):
        low, high = share_interval(int(rng.binomial(20, 0.7)), 20)
        covered['share'] += low <= 0.7 <= high
        low, high = rate_interval(int(rng.poisson(4.0)), 2.0)
        covered['rate'] += low <= 2.0 <= high
        low, high = median_interval(rng.exponential(size=15).tolist())
        covered['median'] += low <= math.log(2.0) <= high
    assert covered['share'] > 540
    assert covered['rate'] > 565
    assert covered['median'] > 560
    assert rate_interval(0, 0.0) == (0.0, math.inf)
    assert median_interval([1.0, 2.0]) == (-math.inf, math.inf)
    assert rate_interval(3, 1.0) == (pytest.approx(0.6187, abs=1e-3), pytest.approx(8.767, 1e-3))
