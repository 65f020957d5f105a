# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The induced faults of the real plant: files, schedule, what counts, the table."""

import csv
import math
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from damadics_evaluate import main
from damadics_evaluate.alarms import Alarm, alarms_of
from damadics_evaluate.lublin.files import date_of, read_folder
from damadics_evaluate.lublin.judge import false_alarms, outcomes
from damadics_evaluate.lublin.schedule import SCHEDULE, Induced, events_of
from damadics_evaluate.watching import watch

SHARED = Path(__file__).resolve().parents[5] / 'shared' / 'data'
REAL = SHARED / 'lublin_2001-11-17_1hz.csv'
DAY = date(2001, 11, 17)
EVENT = Induced(1, 1, DAY, 1000.0, 1100.0, 'f16')


def plant(start, end, seed=0):
    """A day's part in the 33 columns of the plant: actuator 3 sticks during its f16."""
    rng = np.random.default_rng(seed)
    t = np.arange(start, end, dtype=float)
    table = np.full((len(t), 33), np.nan)
    table[:, 0] = t
    cv = 50.0 + 10.0 * np.sin(t / 40.0)
    for first in (1, 17, 23):
        table[:, first : first + 4] = [600.0, 300.0, 90.0, 20.0]
        table[:, first : first + 4] += rng.normal(0.0, 1.0, (len(t), 4))
        table[:, first + 4] = cv
        table[:, first + 5] = cv + rng.normal(0.0, 0.2, len(t))
    stuck = (t >= 57475) & (t <= 57530)
    table[stuck, 28] -= 5.0
    return table


def write_daily(file, table):
    np.savetxt(file, table, delimiter='\t', fmt='%.3f')


def run(folder, tmp_path, *options):
    target = tmp_path / 'table.csv'
    assert main(['lublin', str(folder), '--csv', str(target), *options]) == 0
    with target.open() as stream:
        return list(csv.DictReader(stream))


def test_the_schedule_has_19_events_on_4_days():
    assert [e.item for e in SCHEDULE] == list(range(1, 20))
    assert len({e.day for e in SCHEDULE}) == 4
    assert [e.start for e in events_of(date(2001, 11, 9), 1)] == [57275, 58520, 58830]


def test_what_counts_as_found_and_what_as_false():
    def judged(t):
        alarms = [Alarm(t, t + 5.0)]
        found = outcomes('x', [EVENT], alarms)[0]
        return found.t_dt, len(false_alarms([EVENT], alarms, 0.0, 5000.0))

    assert judged(990.0) == (-10.0, 0)
    assert judged(1100.0) == (100.0, 0)
    assert math.isnan(judged(1101.0)[0])
    assert judged(1220.0)[1] == 0  # within two minutes after the event
    assert judged(1221.0)[1] == 1
    assert judged(989.0)[1] == 1


def test_an_alarm_that_stands_already_finds_nothing():
    found = outcomes('x', [EVENT], [Alarm(500.0, 1500.0)])[0]
    assert not found.found
    assert '500 s stood already' in found.note


def test_what_comes_again_within_half_a_minute_is_the_same_alarm():
    t = np.arange(200.0)
    ratio = np.zeros(200)
    ratio[[10, 11, 41, 80]] = 1.0
    assert [(a.start, a.end) for a in alarms_of(t, ratio)] == [(10, 41), (80, 80)]


def test_an_alarm_that_stands_over_a_gap_is_one():
    """As a person sees it: nothing was raised by the first sample after a gap."""
    t = np.r_[np.arange(100.0), np.arange(740.0, 900.0)]
    ratio = np.zeros(len(t))
    ratio[(t >= 90) & (t <= 749)] = 1.0
    alarms = alarms_of(t, ratio)
    assert [(a.start, a.end) for a in alarms] == [(90, 749)]
    assert not false_alarms([Induced(1, 1, DAY, 88.0, 95.0, 'f16')], alarms, 0.0, 900.0)
    ratio[t == 740] = 0.0  # here it is seen to be gone, and comes again
    assert [(a.start, a.end) for a in alarms_of(t, ratio)] == [(90, 99), (741, 749)]


def test_dates_in_file_names():
    assert date_of('17112001.txt') == DAY
    assert date_of('lublin_2001-11-17_1hz.csv') == DAY
    assert date_of('20011117.csv') == DAY
    assert date_of('99999999.txt') is None


def test_parts_of_daily_files_are_put_together(tmp_path, capsys):
    folder = tmp_path / 'days'
    folder.mkdir()
    whole = plant(52880, 58500)
    write_daily(folder / '17112001.txt', whole[:3000])
    header = 't,p74_00,p74_01,t74_00,f74_00,lc74_20cv,lc74_20x'
    rest = np.column_stack((whole[2900:, 0], whole[2900:, 23:29]))
    np.savetxt(
        folder / 'late_2001-11-17.csv', rest, delimiter=',', header=header, comments='', fmt='%g'
    )
    (folder / 'notes.txt').write_text('no table\n')
    record = read_folder(folder, lambda text: None)
    assert len(record[DAY, 1]['stamp']) == 3000
    assert len(record[DAY, 3]['stamp']) == len(whole)
    assert record[DAY, 3]['x1'][0] == pytest.approx(whole[0, 28] / 100.0, abs=1e-5)
    assert record[DAY, 3]['p1'][0] == pytest.approx(whole[0, 23] * 1e3, rel=1e-4)

    lines = run(folder, tmp_path, '--detectors', 'fir_cusum', 'fixed')
    found = {(r['item'], r['detector']): r['t_dt'] for r in lines if r['kind'] == 'event'}
    assert 0 <= float(found['17', 'fir_cusum']) <= 3
    assert found['18', 'fir_cusum'] == ''  # nothing was induced there in this record
    absent = {r['item'] for r in lines if r['kind'] == 'absent'}
    assert {'1', '6', '16'} <= absent
    out = capsys.readouterr()
    assert 'absent from these files' in out.out
    assert 'notes.txt' in out.err
    assert 'learned on 2001-11-17 A3: 52880-53780 s' in out.out


@pytest.mark.parametrize('form', ['   {:.7e}', '{:.7e}\t', ' {:12.4f}', '{:.4f};', '{:.4f},'])
def test_daily_files_are_read_however_their_columns_are_parted(form, tmp_path):
    table = plant(52880, 52980)
    lines = [''.join(form.format(value) for value in row) for row in table]
    (tmp_path / '17112001.txt').write_text('\r\n'.join(lines) + '\r\n')
    record = read_folder(tmp_path, pytest.fail)
    for actuator, first in ((1, 1), (2, 17), (3, 23)):
        columns = record[DAY, actuator]
        assert columns['stamp'].tolist() == [int(t) * 10**9 for t in table[:, 0]]
        assert columns['x1'] == pytest.approx(table[:, first + 5] / 100.0, abs=1e-4)


def test_the_user_states_the_stretch_to_learn_from(tmp_path, capsys):
    folder = tmp_path / 'days'
    folder.mkdir()
    write_daily(folder / '17112001.txt', plant(55000, 57600))
    assert run(folder, tmp_path, '--detectors', 'fixed', '--learn', '55100-56100')
    assert 'A3: 55100-56100 s' in capsys.readouterr().out
    assert main(['lublin', str(folder), '--learn', '9-8']) == 1
    assert '--learn 9-8: give' in capsys.readouterr().err
    assert main(['lublin', str(folder), '--detectors', 'fixed', '--learn', '1000-2000']) == 0
    assert 'state another: --learn START-END' in capsys.readouterr().out


def test_missing_values_and_repeated_rows_do_no_harm(tmp_path):
    folder = tmp_path / 'days'
    folder.mkdir()
    table = plant(52880, 57600)
    table[100:110, 28] = np.nan
    table[300:, 23][::50] = np.nan
    table[4000, 1:] = table[3999, 1:]
    write_daily(folder / '17112001.txt', table)
    lines = run(folder, tmp_path, '--detectors', 'fir_cusum', 'pca')
    found = {(r['item'], r['detector']): r['t_dt'] for r in lines if r['kind'] == 'event'}
    assert 0 <= float(found['17', 'fir_cusum']) <= 3


@pytest.mark.parametrize('content', [None, 'nothing\n'])
def test_a_folder_without_tables_is_an_error(tmp_path, capsys, content):
    if content:
        (tmp_path / '17112001.txt').write_text(content)
    assert main(['lublin', str(tmp_path)]) == 1
    assert 'no table of the plant' in capsys.readouterr().err.splitlines()[-1]


def test_other_days_than_those_of_the_schedule_are_an_error(tmp_path, capsys):
    write_daily(tmp_path / '18112001.txt', plant(0, 500))
    assert main(['lublin', str(tmp_path)]) == 1
    assert '2001-10-30' in capsys.readouterr().err


@pytest.mark.skipif(not REAL.exists(), reason=f'no {REAL.name} beside the repository')
def test_the_real_plant(tmp_path):
    lines = run(REAL, tmp_path, '--detectors', 'fir_cusum')
    t_dt = {int(r['item']): r['t_dt'] for r in lines if r['kind'] == 'event'}
    assert [t_dt[i] for i in (6, 8, 9, 17, 18)] == ['9', '5', '2', '4', '5']
    assert t_dt[5] == ''  # f18 is found only after its end
    assert sum(r['kind'] == 'absent' for r in lines) == 9


@pytest.mark.parametrize('zero', [0.0, 50000.0])
def test_a_record_that_another_one_was_learned_for(zero):
    """The valve stands elsewhere at its start, which is no jump; stamps may begin at 0."""
    rng = np.random.default_rng(5)

    def columns(start, n, cv):
        noise = rng.normal(0.0, 0.002, n)
        stamp = ((start + np.arange(n)) * 1e9).astype(np.int64)
        return {'stamp': stamp, 'cv': cv, 'x1': np.r_[cv[:1], cv[:-1]] + noise}

    t = np.arange(900.0)
    learning = columns(70000.0, 900, 0.5 + 0.2 * np.sin(t / 20.0))
    record = columns(zero, 900, 0.5 - 0.2 * np.cos(t / 20.0))
    assert watch('scada', learning, record, zero) == []
    record['x1'][700:] = record['x1'][700]
    alarms = watch('scada', learning, record, zero)
    assert [zero + 700.0 <= a.start <= zero + 730.0 for a in alarms] == [True]


@pytest.mark.skipif(not REAL.exists(), reason=f'no {REAL.name} beside the repository')
@pytest.mark.parametrize('step', [1, -1])
def test_mode_scada_raises_nothing_false_on_the_real_plant(tmp_path, step):
    """Also where the parts of the day come in another order, as parts of files do."""
    parts = REAL.read_text().splitlines(keepends=True)
    for i, part in enumerate(([parts[0], *parts[1:2000]], [parts[0], *parts[2000:]])[::step]):
        (tmp_path / f'part{i}_2001-11-17.csv').write_text(''.join(part))
    lines = run(tmp_path, tmp_path, '--detectors', 'scada', '--learn', '52880-53780')
    t_dt = {int(r['item']): r['t_dt'] for r in lines if r['kind'] == 'event'}
    latest = {5: 5.0, 6: 9.0, 8: 5.0, 9: 2.0, 17: 4.0, 18: 5.0, 19: 30.0}  # FIR + CUSUM, or sooner
    assert set(t_dt) == set(latest)
    assert [i for i, value in t_dt.items() if not -10.0 <= float(value) <= latest[i]] == []
    assert [r['start'] for r in lines if r['kind'] == 'false alarm'] == []
