# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Replay of bags, tables and plant files; each way of reading gives the same decisions."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.bag import BagWriter, read_columns, write_columns
from damadics_fd.bag.recording import Recording, find_recordings
from damadics_fd.bag.tables.headers import LUBLIN
from damadics_fd.commands.replay import output
from damadics_fd.commands.replay.replay import main, unique_stems
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings

from ..bag.bag_support import as_csv, needs_messages, replayed, stroke

SHARED = Path(__file__).parents[5].parent / 'shared' / 'data'


@needs_messages
def test_the_result_is_a_list_of_bags_with_detections(tmp_path, capsys):
    columns = stroke()
    write_columns(tmp_path / 'a.mcap', columns)
    (result,) = replayed(tmp_path / 'a.mcap', '--figures', tmp_path / 'figures')
    expected = run(columns, Settings.for_mode('paper')).detections
    assert result['bag'] == str(tmp_path / 'a.mcap')
    assert (result['mode'], result['samples']) == ('paper', 12_000)
    assert result['duration_s'] == pytest.approx(29.9975)
    assert result['samples_per_s'] > 0
    assert [d['t'] for d in result['detections']] == [event.stamp / 1e9 for event in expected]
    assert [d['residual'] for d in result['detections']] == [e.residual for e in expected]
    assert any(20.0 <= d['t'] < 20.01 for d in result['detections'])
    assert (tmp_path / 'figures' / 'a.png').stat().st_size > 50_000
    assert '12,000' in capsys.readouterr().out


def test_a_clock_that_was_set_back_shortens_no_recording(tmp_path, capsys):
    columns = stroke()
    columns['stamp'][6000:] -= 3600 * 10**9
    columns['stamp'] += 2 * 3600 * 10**9
    as_csv(columns, tmp_path / 'a.csv')
    (result,) = replayed(tmp_path / 'a.csv')
    assert result['duration_s'] == pytest.approx(29.995)


def test_a_terminal_without_the_letters_of_a_name_shows_them_otherwise(tmp_path):
    as_csv(stroke(), tmp_path / 'Ventil_Ö.csv')
    done = subprocess.run(
        [sys.executable, '-m', 'damadics_fd.commands.replay.replay', tmp_path / 'Ventil_Ö.csv'],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path), 'PYTHONIOENCODING': 'ascii'},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert r'Ventil_\xd6.csv' in done.stdout


@needs_messages
def test_bag_table_and_mapped_topics_give_the_same_detections(tmp_path):
    columns = stroke()
    write_columns(tmp_path / 'a.mcap', columns)
    as_csv(columns, tmp_path / 'a.csv')
    with BagWriter(tmp_path / 'mapped') as bag:
        for name in ('cv', 'x1'):
            bag.add_topic(f'/valve/{name}', 'damadics_msgs/msg/Float64Stamped')
            bag.write_columns(
                columns['stamp'], {f'/valve/{name}': {'data': columns[name] * 100}}, 'V'
            )
    results = [
        replayed(tmp_path / 'a.mcap'),
        replayed(tmp_path / 'a.csv'),
        replayed(
            tmp_path / 'mapped',
            '--map',
            'cv=/valve/cv.data*0.01',
            '--map',
            'x1=/valve/x1.data*0.01',
        ),
    ]
    detections = [[(d['t'], d['residual']) for d in bag['detections']] for (bag,) in results]
    assert detections[0] == detections[1]
    assert [t for t, _ in detections[2]] == [t for t, _ in detections[0]]


@needs_messages
def test_flags_are_written_as_a_bag_next_to_the_input(tmp_path):
    columns = stroke()
    write_columns(tmp_path / 'a.mcap', columns, frame_id='V9')
    replayed(tmp_path / 'a.mcap', '--bag')
    result = run(columns, Settings.for_mode('paper'))
    residual = read_columns(tmp_path / 'a_flags.mcap', '/residual')
    accepted = result.accepted
    assert residual['data'].tobytes() == result.decisions['residual'][accepted].tobytes()
    assert (residual['stamp'] == columns['stamp'][accepted]).all()
    estimate = read_columns(tmp_path / 'a_flags.mcap', '/estimate', ['xi2', 'frame_id'])
    assert estimate['xi2'].tobytes() == result.estimates['xi2'][accepted].tobytes()
    assert set(estimate['frame_id']) == {'V9'}
    flag = read_columns(tmp_path / 'a_flags.mcap', '/fault_flag')
    rises = flag['stamp'][1:][np.diff(flag['fault'].astype(int)) == 1].tolist()
    known = [event.stamp for event in result.detections]
    assert rises == [stamp for stamp in known if stamp > flag['stamp'][0]]
    assert np.diff(flag['stamp']).max() <= 1_000_000_000


@needs_messages
def test_a_folder_of_bags_is_replayed_over_processes(tmp_path):
    columns = stroke(2000)
    for name in ('a', 'b', 'c'):
        write_columns(tmp_path / 'bags' / name, columns)
    as_csv(columns, tmp_path / 'bags' / 'd.csv')
    out = tmp_path / 'result.csv'
    assert main([str(tmp_path / 'bags'), '--mode', 'paper', '--jobs', '2', '--out', str(out)]) == 0
    rows = list(csv.DictReader(out.open()))
    assert len({row['bag'] for row in rows}) == 4
    assert len({(row['t'], row['residual']) for row in rows}) == len(rows) / 4


def test_tables_with_tags_of_the_plant_are_understood(tmp_path):
    table = tmp_path / 'a.csv'
    table.write_text(
        't_s,P74_00_P1_kPa,P74_01_P2_kPa,T74_00_T1_degC,F74_00_F_tph,LC74_20CV_CV_pct,'
        'LC74_20X_X_pct\n0,3541.9,2601.2,100.7,13.5,68.6,68.3\n1,3523.3,2609,100.7,11.9,60.1,67.9\n'
    )
    (recording,) = find_recordings([table])
    (columns,) = recording.chunks(print)
    assert columns['stamp'].tolist() == [0, 10**9]
    assert columns['p1'] == pytest.approx([3541900.0, 3523300.0])
    assert columns['flow'] == pytest.approx([3.75, 11.9 / 3.6])
    assert columns['cv'] == pytest.approx([0.686, 0.601])
    assert columns['x1'] == pytest.approx([0.683, 0.679])


def test_daily_files_hold_three_actuators(tmp_path):
    rows = np.arange(4 * 33, dtype=float).reshape(4, 33)
    rows[:, 0] = [10, 11, 12, 13]
    rows[2, LUBLIN.index('P51_05')] = np.nan
    np.savetxt(tmp_path / '17112001.txt', rows, delimiter='\t')
    recordings = find_recordings([tmp_path / '17112001.txt'])
    assert [recording.name[-2:] for recording in recordings] == ['A1', 'A2', 'A3']
    (columns,) = recordings[0].chunks(print)
    assert columns['stamp'][0] == 1_005_955_210 * 10**9  # 2001-11-17, 10 s past midnight
    assert np.isnan(columns['p1'][2])
    assert columns['cv'].tolist() == pytest.approx((rows[:, 5] / 100).tolist())
    (only,) = find_recordings([tmp_path / '17112001.txt'], actuator=3)
    (columns,) = only.chunks(print)
    assert columns['x1'].tolist() == pytest.approx((rows[:, 28] / 100).tolist())


@pytest.mark.parametrize(
    'name',
    [
        'lublin_actuator3_20min_1hz.csv',
        'simulink_dgen_nominal_900s.csv',
    ],
)
def test_shared_recordings_are_replayed(name, tmp_path):
    if not (SHARED / name).exists():
        pytest.skip(f'{name} is not there: it carries no redistribution licence')
    out = tmp_path / 'a.json'
    assert main([str(SHARED / name), '--mode', 'scada', '--out', str(out)]) == 0
    (result,) = json.loads(out.read_text())
    assert result['samples'] == (1200 if 'lublin' in name else 900)
    assert result['error'] == ''


def test_no_two_recordings_share_the_name_of_a_picture():
    paths = ['x/a.mcap', 'y/a.mcap', 'x/a_2.mcap', 'run.1.mcap', 'run.2.mcap', 'z/a']
    stems = list(unique_stems([Recording(Path(path)) for path in paths]))
    assert stems == ['a', 'a_2', 'a_2_2', 'run.1', 'run.2', 'a_3']


@needs_messages
def test_every_format_tells_the_same(tmp_path):
    parquet = pytest.importorskip('pyarrow.parquet')
    write_columns(tmp_path / 'a.mcap', stroke())
    for suffix in ('json', 'csv', 'parquet'):
        arguments = [str(tmp_path / 'a.mcap'), '--mode', 'paper', '--out']
        assert main([*arguments, str(tmp_path / f'a.{suffix}')]) == 0
    (result,) = json.loads((tmp_path / 'a.json').read_text())
    with (tmp_path / 'a.csv').open() as file:
        lines = list(csv.DictReader(file))
    rows = parquet.read_table(tmp_path / 'a.parquet').to_pylist()
    assert len(result['detections']) == len(lines) == len(rows) > 1
    for detection, line, row in zip(result['detections'], lines, rows, strict=True):
        assert detection.items() <= row.items()
        assert (row['bag'], row['mode'], row['samples']) == (result['bag'], 'paper', 12_000)
        assert {
            name: '' if value is None else str(value)
            for name, value in row.items()
            if name != 'samples_per_s'
        } == {name: value for name, value in line.items() if name != 'samples_per_s'}


@needs_messages
def test_parquet_without_its_library_is_refused_at_once(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(output, 'find_spec', lambda name: None)
    write_columns(tmp_path / 'a.mcap', stroke(2000))
    out = tmp_path / 'a.parquet'
    assert main([str(tmp_path / 'a.mcap'), '--mode', 'paper', '--out', str(out)]) == 1
    assert 'pip install pyarrow' in capsys.readouterr().err
    assert not out.exists()
