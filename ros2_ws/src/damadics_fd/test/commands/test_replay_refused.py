# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Replay of what is no good recording: a clear message, and the rest is replayed all the same."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.bag import BagWriter, write_columns
from damadics_fd.bag.recording import find_recordings
from damadics_fd.bag.rosbag2 import qos
from damadics_fd.commands.replay.replay import main

from ..bag.bag_support import as_csv, needs_messages, replayed, stroke


@pytest.mark.parametrize(
    ('args', 'reason'),
    [
        (['nowhere.mcap'], 'does not exist'),
        (['x.csv'], 'lacks a time, a control value or a position'),
        (['x.csv', '--out', 'x.xls'], 'the suffix must be one of'),
        (['x.csv', '--map', 'cv'], 'write SIGNAL='),
        (['x.csv', '--map', 'cv=none'], 'there is no such column'),
        (['x.csv', '--map', 'cv=1-SP*0.01'], r'write SP\[UNIT\] invert, or SP\*-FACTOR\+1'),
        (['x.csv', '--set', 'k1=-1', '--set', 'bogus=2'], r'bogus: no such setting.*k1 = -1'),
        (['x.csv', '--set', 'tlearn=3'], r'do you mean t_learn\?'),
    ],
)
def test_errors_are_one_line_on_stderr(args, reason, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('x.csv').write_text('a,b\n1,2\n')
    assert main(args) == (2 if '--set' in args else 1)
    error = capsys.readouterr().err
    assert error.startswith('replay: ')
    assert error.count('\n') == 1
    assert re.search(reason, error)


@pytest.mark.parametrize(
    ('name', 'content', 'reason'),
    [
        ('a.xlsx', b'PK\x03\x04 and so on', 'is a spreadsheet; save it as CSV'),
        ('a.xls', b'\xd0\xcf\x11\xe0 and so on', 'is a file of Excel; save it as CSV'),
        ('a.mat', b'MATLAB 5.0 MAT-file', 'is a file of MATLAB; save it as CSV or Parquet'),
        ('a.h5', b'\x89HDF\r\n\x1a\n', 'is HDF5, as MATLAB writes it; save it as CSV'),
        ('a.feather', b'ARROW1\0\0', 'is an Arrow file; save it as Parquet'),
    ],
)
def test_tables_of_other_programs_are_told_with_a_remedy(name, content, reason, tmp_path, capsys):
    (tmp_path / name).write_bytes(content)
    assert main([str(tmp_path / name)]) == 1
    assert capsys.readouterr().err.startswith(f'replay: {tmp_path / name}: {reason}')


@pytest.mark.parametrize(
    ('content', 'reason'),
    [
        (None, 'holds no .mcap file; give a bag, or a folder of bags'),
        (b'PK\x03\x04 and so on', 'is a ZIP archive; unpack it first'),
        (b'\x1f\x8b and so on', 'is compressed by gzip; unpack it first'),
        (b'', 'is empty'),
        (b'something else altogether', 'does not start as an MCAP file, and nothing in it can be'),
    ],
)
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


@pytest.mark.parametrize(
    'args',
    [
        ['--live', '--out', 'a.json'],
        ['--live', '--bag'],
        ['--rate', '2'],
        ['--inputs-only'],
        ['--live', '--rate', 'nan'],
    ],
)
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
    (result,) = replayed(path, code=0 if closed else 3)
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
        'is a ZIP archive; unpack it first',
        'does not exist',
    ]


def test_cells_of_spreadsheets_are_understood_and_cut_lines_left_out(tmp_path):
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
    assert (
        "1 lines are no rows of numbers and are left out, first line 4001: '9,9;0,'"
        in (result['problems'][0])
    )
    assert result['detections'][0]['t'] == expected['detections'][0]['t']


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


def test_fast_samples_in_mode_scada_are_led_to_the_other_mode(tmp_path, capsys):
    columns = stroke(4000)
    table = as_csv(columns, tmp_path / 'fast.csv')
    rate = 1e9 / float(np.diff(columns['stamp']).mean())
    out = tmp_path / 'fast.json'
    assert main([str(table), '--mode', 'scada', '--out', str(out)]) == 0
    said = f'samples at {rate:.0f} Hz, for which there is --mode monitor'
    assert said in json.loads(out.read_text())[0]['status']
    printed = capsys.readouterr().out
    assert said in printed and f'written: {out}' in printed
    columns['stamp'] = np.arange(4000) * 10**9
    assert main([str(as_csv(columns, tmp_path / 'slow.csv')), '--mode', 'scada']) == 0
    assert '--mode monitor' not in capsys.readouterr().out


def test_results_that_cannot_be_written_are_refused_before_the_work(tmp_path, capsys):
    table = as_csv(stroke(1000), tmp_path / 'a.csv')
    for option in (['--out', str(table / 'a.json')], ['--figures', str(table)]):
        assert main([str(table), '--mode', 'paper', *option]) == 1
        assert f'{table} cannot be created' in capsys.readouterr().err


def test_the_actuator_of_a_table_is_no_option_of_a_bag(tmp_path, capsys):
    assert main([str(tmp_path / 'a.mcap'), '--actuator', '1']) == 2
    assert 'choose with --topic' in capsys.readouterr().err
