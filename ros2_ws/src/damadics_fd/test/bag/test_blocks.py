# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Blocks of many valves in recordings: read, judged as single valves, and told where odd."""

import json

import numpy as np
import pytest
from damadics_fd.bag import BagError, BagWriter, read_columns, write_columns, write_parquet
from damadics_fd.bag.blocks.reader import BlockReader
from damadics_fd.bag.blocks.together import read_together
from damadics_fd.bag.recording import find_recordings
from damadics_fd.commands.replay.replay import main
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings

from .bag_support import needs_messages, replayed
from .block_support import SIGNALS, Blocks, valves, write_blocks

pytestmark = needs_messages
SAME = ('samples', 'duration_s', 'verdict', 'detections', 'refused', 'status')


def alike(one, other) -> bool:
    return all(one[name] == other[name] for name in SAME)


def three_rows(**changed):
    rows = {name: np.full(3, 0.5) for name in SIGNALS}
    return {'valve': [0, 1, 0], 'stamp': [10, 10, 20], **rows, **changed}


def test_a_valve_of_blocks_reads_as_if_it_had_a_topic_of_its_own(tmp_path):
    columns = valves()
    columns['/lv2']['ps'][:] = np.nan
    write_blocks(tmp_path / 'fleet.mcap', columns)
    for name, own in columns.items():
        found = read_columns(tmp_path / 'fleet.mcap', '/measurement_block', valve=name)
        assert found.keys() == {*own, 'log_time'}
        for signal, column in own.items():
            assert found[signal].tobytes() == column.tobytes(), (name, signal)
    some = read_columns(tmp_path / 'fleet.mcap', 'measurement_block', ['x1'], valve='lv1')
    assert some.keys() == {'x1', 'stamp', 'log_time'}
    with pytest.raises(BagError, match='has no valve /lv9; it has /lv0, /lv1'):
        read_columns(tmp_path / 'fleet.mcap', '/measurement_block', valve='/lv9')
    with pytest.raises(BagError, match='has no field speed'):
        read_columns(tmp_path / 'fleet.mcap', '/measurement_block', ['speed'], valve='/lv1')


def test_replay_gives_a_verdict_per_valve_equal_to_that_of_its_monitor(tmp_path):
    columns = valves(3)
    write_blocks(tmp_path / 'fleet.mcap', columns)
    results = replayed(tmp_path / 'fleet.mcap')
    assert [r['bag'] for r in results] == [f'{tmp_path}/fleet.mcap#{name}' for name in columns]
    for result, (name, own) in zip(results, columns.items(), strict=True):
        write_columns(tmp_path / f'{name[1:]}.mcap', own)
        (alone,) = replayed(tmp_path / f'{name[1:]}.mcap')
        assert alike(result, alone), name
        expected = run(own, Settings.for_mode('paper')).detections
        assert [d['stamp'] for d in result['detections']] == [e.stamp for e in expected]
    assert results[0]['verdict'] == 'fault'
    assert sum(r['samples'] for r in results) == 3 * 3000


def test_several_processes_share_the_valves_of_a_file(tmp_path):
    write_blocks(tmp_path / 'fleet.mcap', valves(3, 1000))
    one = replayed(tmp_path / 'fleet.mcap')
    words = ['--mode', 'paper', '--jobs', '2', '--out', str(tmp_path / 'two.json')]
    assert main([str(tmp_path / 'fleet.mcap'), *words]) == 0
    two = json.loads((tmp_path / 'two.json').read_text())
    assert [r['bag'] for r in one] == [r['bag'] for r in two]
    assert all(map(alike, one, two))


def test_one_valve_is_chosen_by_its_name(tmp_path, capsys):
    write_blocks(tmp_path / 'fleet.mcap', valves(3, 500))
    for topic in ('/lv1/measurement', 'lv1'):
        (only,) = replayed(tmp_path / 'fleet.mcap', '--topic', topic)
        assert only['bag'].endswith('fleet.mcap#/lv1')
    assert len(replayed(tmp_path / 'fleet.mcap', '--topic', '/measurement_block')) == 3
    assert main([str(tmp_path / 'fleet.mcap'), '--topic', '/lv9/measurement']) == 1
    assert 'has no topic /lv9/measurement' in capsys.readouterr().err


def test_flags_of_each_valve_are_written_under_its_name(tmp_path):
    columns = valves(2, 800)
    write_blocks(tmp_path / 'fleet.mcap', columns)
    replayed(tmp_path / 'fleet.mcap', '--bag', tmp_path / 'flags')
    for name in columns:
        file = tmp_path / 'flags' / f'fleet_{name[1:]}_flags.mcap'
        residual = read_columns(file, f'{name}/residual', ['data', 'frame_id'])
        assert len(residual['data']) and set(residual['frame_id']) == {name[1:].upper()}


def test_parquet_of_many_valves_gives_what_the_blocks_give(tmp_path):
    pytest.importorskip('pyarrow')
    columns = valves(3, 1500)
    write_blocks(tmp_path / 'fleet.mcap', columns)
    assert write_parquet(tmp_path / 'fleet.mcap', tmp_path / 'fleet.parquet') == 3 * 1500
    with pytest.raises(BagError, match='exists'):
        write_parquet(tmp_path / 'fleet.mcap', tmp_path / 'fleet.parquet')
    blocks = replayed(tmp_path / 'fleet.mcap')
    table = replayed(tmp_path / 'fleet.parquet')
    assert [r['bag'] for r in table] == [f'{tmp_path}/fleet.parquet#{name}' for name in columns]
    assert all(map(alike, blocks, table))
    (one, *_) = find_recordings([tmp_path / 'fleet.parquet'])
    (piece,) = one.chunks(lambda text: None)
    for name in ('stamp', 'x1'):
        assert piece[name].tobytes() == columns['/lv0'][name].tobytes()


@pytest.mark.plain
def test_rows_of_a_table_without_a_valve_are_refused(tmp_path, capsys):
    pyarrow = pytest.importorskip('pyarrow')
    from pyarrow import parquet

    table = {'valve': ['/a', None], 'stamp': [1, 2], 'cv': [0.5, 0.5], 'x1': [0.5, 0.5]}
    parquet.write_table(pyarrow.table(table), tmp_path / 'a.parquet')
    assert main([str(tmp_path / 'a.parquet'), '--mode', 'paper']) == 1
    assert '1 rows name no valve' in capsys.readouterr().err


@pytest.mark.plain
def test_a_new_layout_renumbers_the_valves(tmp_path):
    with Blocks(tmp_path / 'a.mcap') as bag:
        bag.layout(1, ['/a', '/b'])
        bag.block(1, **three_rows(x1=[0.1, 0.2, 0.3]))
        bag.layout(2, ['/b', '/c', '/a'])
        bag.block(2, **three_rows(stamp=[30, 30, 40], x1=[0.4, 0.5, 0.6]))
    for name, x1 in {'/a': [0.1, 0.3], '/b': [0.2, 0.4, 0.6], '/c': [0.5]}.items():
        found = read_columns(tmp_path / 'a.mcap', '/measurement_block', valve=name)
        assert found['x1'].tolist() == x1, name


@pytest.mark.plain
def test_each_block_topic_has_the_layout_beside_it(tmp_path):
    for place, name in (('/north', '/n'), ('/south', '/s')):
        with Blocks(tmp_path / place[1:], f'{place}/measurement_block') as bag:
            bag.layout(1, [name, name + '2'])
            bag.block(1, **three_rows())
    names = [r.valve for r in find_recordings([tmp_path])]
    assert names == ['/n', '/n2', '/s', '/s2']


@pytest.mark.plain
def test_a_signal_that_no_valve_measures_is_not_a_number(tmp_path):
    with Blocks(tmp_path / 'a.mcap') as bag:
        bag.layout(1, ['/a', '/b'])
        bag.block(1, **three_rows(ps=[], flow=[]))
        bag.block(1, **three_rows(stamp=[30, 30, 40]))
    found = read_columns(tmp_path / 'a.mcap', '/measurement_block', valve='/a')
    assert np.isnan(found['ps']).tolist() == [True, True, False, False]
    assert found['cv'].tolist() == [0.5] * 4


def odd(bag, what: str) -> None:
    """Write a good block, and one that is odd."""
    if what != 'no layout':
        bag.layout(1, ['/a', '/b'])
    if what == 'two lists':
        bag.layout(1, ['/b', '/a'])
    bag.block(1, **three_rows())
    later = {'stamp': [30, 30, 40]}
    if what == 'version':
        bag.block(9, **three_rows(**later))
    if what == 'lengths':
        bag.block(1, **three_rows(**later, x1=[0.5]))
        bag.block(1, **three_rows(stamp=[30, 30]))
    if what == 'valve':
        bag.block(1, **three_rows(**later, valve=[0, 2**32 - 1, 5]))
    if what == 'stamp':
        bag.block(1, **three_rows(stamp=[30, -(2**63), 40]))


@pytest.mark.plain
@pytest.mark.parametrize(
    ('what', 'text', 'rows'),
    [
        ('version', '1 blocks are left: they refer to the layout 9', 2),
        ('lengths', '2 blocks are left: their arrays differ in length', 2),
        ('valve', '2 rows are left: they name a valve that the layout 1 of 2 valves has not', 3),
        ('stamp', '1 rows are left: their stamps lie before time began', 4),
    ],
)
def test_odd_blocks_are_told_and_the_others_judged(tmp_path, capsys, what, text, rows):
    with Blocks(tmp_path / 'a.mcap') as bag:
        odd(bag, what)
    told = []
    reader = BlockReader(tmp_path / 'a.mcap', on_problem=told.append)
    total = sum(len(piece['stamp']) for piece in reader.rows())
    assert text in ' '.join(told)
    own = read_columns(
        tmp_path / 'a.mcap', '/measurement_block', valve='/a', on_problem=told.append
    )
    assert len(own['stamp']) == rows and total >= rows
    with pytest.raises(BagError, match='are left'):
        read_columns(tmp_path / 'a.mcap', '/measurement_block', valve='/a')
    words = ['--mode', 'paper', '--jobs', '1', '--out', str(tmp_path / 'a.json')]
    assert main([str(tmp_path / 'a.mcap'), *words]) == 3
    shown = capsys.readouterr().err
    assert shown.count(text) == 1, 'the valves of a file share what is wrong with it'
    results = json.loads((tmp_path / 'a.json').read_text())
    assert len(results) == 2 and all(r['lossy'] and r['problems'] for r in results)


@pytest.mark.plain
@pytest.mark.parametrize(
    ('what', 'text'),
    [
        ('no layout', 'there is no list of valves: record /fleet/layout with them'),
        ('two lists', 'there is no list of valves'),
    ],
)
def test_blocks_whose_valves_are_unknown_are_no_result(tmp_path, capsys, what, text):
    with Blocks(tmp_path / 'a.mcap') as bag:
        odd(bag, what)
    out = tmp_path / 'a.json'
    assert main([str(tmp_path / 'a.mcap'), '--mode', 'paper', '--out', str(out)]) == 1
    assert text in capsys.readouterr().err
    assert [r['verdict'] for r in json.loads(out.read_text())] == ['failed']
    with pytest.raises(BagError):
        read_columns(tmp_path / 'a.mcap', '/measurement_block', valve='/a')


@pytest.mark.plain
def test_a_valve_without_samples_is_not_monitored(tmp_path):
    with Blocks(tmp_path / 'a.mcap') as bag:
        bag.layout(1, ['/a', '/b', '/silent'])
        bag.block(1, **three_rows())
    *_, silent = replayed(tmp_path / 'a.mcap')
    assert (silent['verdict'], silent['samples']) == ('not monitored', 0)
    assert silent['status'] == 'no sample in the blocks'


def test_damage_in_a_file_of_blocks_is_told(tmp_path, capsys):
    path = tmp_path / 'fleet.mcap'
    columns = valves(2, 4000)
    write_blocks(path, columns, sizes=(400,))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])  # as after a crash
    words = ['--mode', 'paper', '--jobs', '1', '--out', str(tmp_path / 'a.json')]
    assert main([str(path), *words]) == 3
    assert 'ends' in capsys.readouterr().err
    results = json.loads((tmp_path / 'a.json').read_text())
    assert all(0 < r['samples'] < 4000 and r['lossy'] for r in results)


def test_blocks_beside_single_topics(tmp_path):
    columns = valves(2, 300)
    write_blocks(tmp_path / 'bags' / 'fleet', columns)
    with BagWriter(tmp_path / 'bags' / 'single') as bag:
        bag.add_topic('/lv9/measurement', 'damadics_msgs/msg/Measurement')
        own = {name: column for name, column in columns['/lv0'].items() if name != 'stamp'}
        bag.write_columns(columns['/lv0']['stamp'], {'/lv9/measurement': own}, 'LV9')
    found = replayed(tmp_path / 'bags')
    assert [r['bag'].partition('#')[2] for r in found] == ['/lv0', '/lv1', '/lv9/measurement']


@pytest.mark.plain
def test_a_table_of_many_valves_has_the_rows_of_the_blocks(tmp_path):
    pytest.importorskip('pyarrow')
    with Blocks(tmp_path / 'a.mcap') as bag:
        bag.layout(1, ['/a', '/b'])
        bag.block(1, **three_rows(x1=[0.1, 0.2, 0.3]))
    assert write_parquet(tmp_path / 'a.mcap', tmp_path / 'a.parquet') == 3
    for path in (tmp_path / 'a.mcap', tmp_path / 'a.parquet'):
        found = find_recordings([path])
        rows = {found[n].name[-2:]: piece['x1'].tolist() for n, piece in read_together(found, str)}
        assert rows == {'/a': [0.1, 0.3], '/b': [0.2]}
        assert [c['x1'].tolist() for one in found for c in one.chunks(str)] == [[0.1, 0.3], [0.2]]
