# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Replay of bags, tables and plant files; each way of reading gives the same decisions."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from damadics_fd import replay_output
from damadics_fd.bag import BagError, BagWriter, read_columns, write_columns
from damadics_fd.bag.recording import Recording, find_recordings, parse_maps
from damadics_fd.bag.rosbag2 import qos
from damadics_fd.bag.tables import LUBLIN
from damadics_fd.core.pipeline import run
from damadics_fd.core.settings import Settings
from damadics_fd.replay import main, unique_stems

from .bag_support import needs_messages

SHARED = Path(__file__).parents[4].parent / 'shared' / 'data'


def stroke(n: int = 12_000, rate: float = 400.0) -> dict[str, np.ndarray]:
    """A stem that sticks and jumps at 20 s."""
    t = np.arange(1, n + 1) / rate
    x1 = np.clip((t - 2.0) * 0.05, 0.0, 1.0)
    x1[t >= 20.0] += 0.01
    columns = {name: np.full(n, value) for name, value in
               {'p1': 3.5e6, 'p2': 2.6e6, 't1': 20.0, 'flow': 8.0, 'ps': 1e5}.items()}
    return columns | {
        'stamp': np.round(t * 1e9).astype(np.int64), 'cv': np.ones(n), 'x1': x1,
        'fault': np.where(t >= 20.0, 4, 0), 'strength': np.where(t >= 20.0, 1.0, 0.0),
    }


def as_csv(columns: dict[str, np.ndarray], path: Path, header: str = '') -> Path:
    names = ['cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps', 'fault', 'strength']
    with path.open('w') as file:
        file.write((header or ','.join(['t', *names])) + '\n')
        for row in zip(columns['stamp'] / 1e9, *(columns[n] for n in names), strict=True):
            file.write(','.join(map(repr, map(float, row))) + '\n')
    return path


def replayed(*args: object) -> list[dict]:
    out = Path(str(args[0])).parent / 'result.json'
    assert main([*map(str, args), '--mode', 'paper', '--out', str(out), '--jobs', '1']) == 0
    return json.loads(out.read_text())


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


@needs_messages
def test_bag_table_and_mapped_topics_give_the_same_detections(tmp_path):
    columns = stroke()
    write_columns(tmp_path / 'a.mcap', columns)
    as_csv(columns, tmp_path / 'a.csv')
    with BagWriter(tmp_path / 'mapped') as bag:
        for name in ('cv', 'x1'):
            bag.add_topic(f'/valve/{name}', 'damadics_msgs/msg/Float64Stamped')
            bag.write_columns(columns['stamp'], {f'/valve/{name}': {'data': columns[name] * 100}},
                              'V')
    results = [
        replayed(tmp_path / 'a.mcap'), replayed(tmp_path / 'a.csv'),
        replayed(tmp_path / 'mapped', '--map', 'cv=/valve/cv.data*0.01', '--map',
                 'x1=/valve/x1.data*0.01'),
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


@pytest.mark.parametrize('name', [
    'lublin_actuator3_20min_1hz.csv', 'simulink_dgen_nominal_900s.csv',
])
def test_shared_recordings_are_replayed(name, tmp_path):
    if not (SHARED / name).exists():
        pytest.skip(f'{name} is not here')
    out = tmp_path / 'a.json'
    assert main([str(SHARED / name), '--mode', 'scada', '--out', str(out)]) == 0
    (result,) = json.loads(out.read_text())
    assert result['samples'] == (1200 if 'lublin' in name else 900)
    assert result['error'] == ''


@pytest.mark.parametrize(('args', 'reason'), [
    (['nowhere.mcap'], 'does not exist'),
    (['x.csv'], 'lacks a time, a control value or a position'),
    (['x.csv', '--out', 'x.xls'], 'the suffix must be one of'),
    (['x.csv', '--map', 'cv'], 'write SIGNAL='),
    (['x.csv', '--map', 'cv=none'], 'there is no such column'),
    (['x.csv', '--set', 'k1=-1', '--set', 'bogus=2'], r'bogus: no such setting.*k1 = -1'),
])
def test_errors_are_one_line_on_stderr(args, reason, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('x.csv').write_text('a,b\n1,2\n')
    assert main(args) == 1
    error = capsys.readouterr().err
    assert error.startswith('replay: ')
    assert error.count('\n') == 1
    assert re.search(reason, error)


@pytest.mark.parametrize(('content', 'reason'), [
    (None, 'holds no .mcap file; give a bag, or a folder of bags'),
    (b'PK\x03\x04 and so on', 'is a ZIP archive; unpack it first'),
    (b'\x1f\x8b and so on', 'is compressed by gzip; unpack it first'),
    (b'', 'is empty'),
    (b'something else altogether', 'does not start as an MCAP file, and nothing in it can be'),
])
def test_what_is_no_recording_is_told_so(content, reason, tmp_path, capsys):
    path = tmp_path / 'a.mcap'
    if content is None:
        path = tmp_path / 'empty'
        path.mkdir()
    else:
        path.write_bytes(content)
    assert main([str(path)]) == 1
    error = capsys.readouterr().err
    assert error.startswith(f'replay: {path}')
    assert reason in error
    assert error.count('\n') == 1


@pytest.mark.parametrize('args', [
    ['--live', '--out', 'a.json'], ['--live', '--bag'], ['--rate', '2'], ['--inputs-only'],
    ['--live', '--rate', 'nan'],
])
def test_options_that_do_not_go_together_are_refused(args):
    with pytest.raises(SystemExit) as ended:
        main(['a.mcap', *args])
    assert ended.value.code == 2


def with_valves(path: Path, full: int, empty: int) -> Path:
    """Write a bag with some topics of measurements, some of them without a message."""
    columns = stroke(2000)
    stamp = columns.pop('stamp')
    values = {name: columns[name] for name in ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')}
    with BagWriter(path) as bag:
        for number in range(full + empty):
            topic = f'/v{number}/measurement'
            bag.add_topic(topic, 'damadics_msgs/msg/Measurement', [qos()])
            if number < full:
                bag.write_columns(stamp, {topic: values}, 'V')
    return path


@needs_messages
@pytest.mark.parametrize('closed', [True, False])
def test_an_empty_topic_beside_a_full_one_is_told_and_passed_over(closed, tmp_path, capsys):
    path = with_valves(tmp_path / 'a.mcap', 1, 1)
    if not closed:
        path.write_bytes(path.read_bytes()[:-200])
    (result,) = replayed(path)
    assert result['bag'].endswith('#/v0/measurement')
    assert result['samples'] == 2000
    assert 'the topic /v1/measurement is empty; it is left out' in capsys.readouterr().err


@needs_messages
def test_loose_files_in_a_subfolder_are_not_taken_for_one_split_bag(tmp_path):
    for name in ('week/a.mcap', 'week/b.mcap', 'month/day/c', 'split/s_0.mcap', 'split/s_1.mcap'):
        write_columns(tmp_path / name, stroke(10))
    (tmp_path / 'month/day/c/metadata.yaml').unlink()
    found = [recording.path.relative_to(tmp_path) for recording in find_recordings([tmp_path])]
    assert list(map(str, found)) == ['month/day/c', 'split', 'week/a.mcap', 'week/b.mcap']


@needs_messages
def test_a_bag_with_nothing_but_empty_topics_is_an_error(tmp_path, capsys):
    path = with_valves(tmp_path / 'a.mcap', 0, 1)
    assert main([str(path), '--mode', 'paper']) == 1
    assert 'the topic /v0/measurement is empty' in capsys.readouterr().err


@needs_messages
def test_the_rest_of_a_folder_is_replayed_all_the_same(tmp_path, capsys):
    folder = tmp_path / 'bags'
    write_columns(folder / 'a.mcap', stroke(2000))
    (folder / 'notes.txt').write_text('call the plant\n')
    assert main([str(folder), '--mode', 'paper', '--bag', '--jobs', '1']) == 0
    out = tmp_path / 'r.json'
    # now the bag with the flags is there, too: no measurement, no failure
    assert main([str(folder), '--mode', 'paper', '--jobs', '1', '--out', str(out)]) == 0
    assert len(json.loads(out.read_text())) == 1
    told = capsys.readouterr().err
    assert 'a_flags.mcap: has no measurement' in told
    assert 'notes.txt: lacks a time' in told
    (folder / 'b.mcap').write_bytes(b'PK\x03\x04')
    paths = [str(folder), str(tmp_path / 'nowhere')]
    assert main([*paths, '--mode', 'paper', '--jobs', '1', '--out', str(out)]) == 1
    good, *bad = json.loads(out.read_text())
    assert (good['samples'], good['error']) == (2000, '')
    assert [text['error'].split(': ')[1] for text in bad] == [
        'is a ZIP archive; unpack it first', 'does not exist']


def test_cells_of_spreadsheets_are_understood_and_cut_lines_left_out(tmp_path, capsys):
    whole = as_csv(stroke(4000), tmp_path / 'whole.csv')
    (expected,) = replayed(whole)
    lines = whole.read_text().splitlines()
    spelled = [line.replace(',', ';').replace('.', ',') for line in lines]
    time, *cells = spelled[2000].split(';')
    spelled[2000] = ';'.join([time, '', *cells[1:]])
    (tmp_path / 'spelled.csv').write_text('\n'.join(spelled[:-1]) + '\n9,9;0,')
    (result,) = replayed(tmp_path / 'spelled.csv')
    assert result['samples'] == 3999
    assert result['refused'] == {'not_finite': 1}
    assert "1 lines are no rows of numbers and are left out, first line 4001: '9,9;0,'" in (
        result['problems'][0])
    assert result['detections'][0]['t'] == expected['detections'][0]['t']
    dates = tmp_path / 'dates.csv'
    dates.write_text('t,cv,x1\n2026-11-22 09:00:00,0.1,0.2\n2026-11-22 09:00:01,0.1,0.2\n')
    assert main([str(dates), '--mode', 'paper']) == 1
    assert 'line 2' in (told := capsys.readouterr().err)
    assert 'time has to be in seconds' in told


def test_refused_and_unlearned_recordings_are_no_clean_bill_of_health(tmp_path, capsys):
    columns = stroke(4000)
    columns['ps'][:] = np.nan
    table = as_csv(columns, tmp_path / 'a.csv')
    assert main([str(table), '--mode', 'monitor']) == 1
    assert 'ps not measured, but mode monitor needs cv, x1, p1, p2, ps' in capsys.readouterr().err
    table = as_csv(stroke(4000), tmp_path / 'b.csv')
    out = tmp_path / 'b.json'
    assert main([str(table), '--mode', 'monitor', '--out', str(out)]) == 0
    assert json.loads(out.read_text())[0]['status'].startswith('learning')
    assert 'none: learning' in capsys.readouterr().out


def test_results_that_cannot_be_written_are_refused_before_the_work(tmp_path, capsys):
    table = as_csv(stroke(1000), tmp_path / 'a.csv')
    for option in (['--out', str(table / 'a.json')], ['--figures', str(table)]):
        assert main([str(table), '--mode', 'paper', *option]) == 1
        assert f'{table} cannot be created' in capsys.readouterr().err


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
        assert {name: '' if value is None else str(value) for name, value in row.items()
                if name != 'samples_per_s'} == {
            name: value for name, value in line.items() if name != 'samples_per_s'}


@needs_messages
def test_parquet_without_its_library_is_refused_at_once(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(replay_output, 'find_spec', lambda name: None)
    write_columns(tmp_path / 'a.mcap', stroke(2000))
    out = tmp_path / 'a.parquet'
    assert main([str(tmp_path / 'a.mcap'), '--mode', 'paper', '--out', str(out)]) == 1
    assert 'pip install pyarrow' in capsys.readouterr().err
    assert not out.exists()


def test_maps_name_signal_source_and_factor():
    assert parse_maps(['x1=/a/b.c.d*1e-2', 'cv=CV']) == {
        'x1': ('/a/b.c.d', 0.01), 'cv': ('CV', 1.0)
    }
    with pytest.raises(BagError, match='SIGNAL is one of'):
        parse_maps(['speed=/a.b'])
