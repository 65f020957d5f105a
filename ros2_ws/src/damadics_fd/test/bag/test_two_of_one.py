# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where two columns or fields may be one signal, none is taken in silence."""

import struct

import numpy as np
import pytest
from damadics_fd.bag import BagError, read_columns, write_columns
from damadics_fd.bag.mapping import parse_maps
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.bag.recording import find_recordings
from damadics_fd.commands.replay.replay import main
from damadics_fd.core.sample import SIGNALS

from .bag_support import needs_messages, simulated

pytestmark = pytest.mark.plain

ROWS = 20


def table(path, heads: list[str]):
    """Column 0 holds the time; the others hold 100, 200, ... times their number."""
    values = [np.arange(ROWS) * 0.5, *(np.full(ROWS, 100.0 * n) for n in range(1, len(heads)))]
    if path.suffix == '.parquet':
        pa = pytest.importorskip('pyarrow')
        from pyarrow import parquet

        parquet.write_table(pa.table([pa.array(v) for v in values], names=heads), path)
    else:
        rows = '\n'.join(','.join(map(repr, row)) for row in np.array(values).T.tolist())
        path.write_text(','.join(heads) + '\n' + rows + '\n')
    return path


def read(path, *maps: str, actuator: int | None = None) -> dict[str, np.ndarray]:
    (recording,) = find_recordings([path], maps=parse_maps(maps), actuator=actuator)
    return next(iter(recording.chunks(pytest.fail)))


DOUBTFUL = {
    'one name': (['t', 'cv', 'x1', 'x1'], 'x1'),
    'one name, the control value': (['t', 'cv', 'cv', 'x1'], 'cv'),
    'one name, the time': (['t', 'cv', 'x1', 't'], 't'),
    'a signal that may be absent': (['t', 'cv', 'x1', 'ps', 'ps'], 'ps'),
    'pandas': (['t', 'cv', 'x1', 'x1.1'], 'x1'),
    'pandas, with a unit': (['t', 'cv [%]', 'x1 [%]', 'x1 [%].1'], 'x1'),
    'pandas, the time': (['time', 'time.1', 'cv', 'x1'], 't'),
    'polars': (['t', 'cv', 'x1', 'x1_duplicated_0'], 'x1'),
    'capitals': (['t', 'cv', 'x1', 'X1'], 'x1'),
    'capitals first': (['t', 'CV', 'cv', 'x1'], 'cv'),
    'a unit': (['t', 'cv', 'x1', 'x1 [%]'], 'x1'),
    'two units': (['t', 'cv', 'x1', 'ps [bar]', 'ps [kPa]'], 'ps'),
    'the unit behind a slash': (['t', 'cv', 'x1/%', 'x1 [%]'], 'x1'),
    'ours and the benchmark': (['t', 'cv', 'x1', 'X_norm'], 'x1'),
    'the benchmark': (['t', 'CV', 'X', 'X_norm'], 'x1'),
    'tags of the plant': (['t', 'LC51_03CV', 'LC51_03X', 'lc51_03x'], 'x1'),
    'two spellings of a tag': (['t', 'LC74_20CV', 'LC74_20X', 'L74_20X'], 'x1'),
    'additions to a tag': (['t', 'LC51_03CV', 'LC51_03X', 'P51_05_a', 'P51_05_b'], 'p1'),
    'a tag and ours': (['t', 'LC51_03CV', 'LC51_03X', 'P51_05', 'p1'], 'p1'),
    'two dates': (['date', 'Date', 'cv', 'x1'], 't'),
    'what the plant knows': (['t', 'cv', 'x1', 'fault', 'fault'], 'fault'),
}


@pytest.mark.parametrize('suffix', ['csv', 'parquet'])
@pytest.mark.parametrize('case', DOUBTFUL)
def test_two_columns_of_one_signal_are_refused_with_the_remedy(case, suffix, tmp_path, capsys):
    heads, signal = DOUBTFUL[case]
    path = table(tmp_path / f'a.{suffix}', heads)
    with pytest.raises(BagError, match=f'{signal} may be any of') as refused:
        read(path)
    wanted = 'rename' if signal == 'fault' else f"--map '{signal}=#"
    assert wanted in refused.value.reason
    assert main([str(path), '--mode', 'paper']) == 1
    assert f'{path}: {signal} may be any of' in capsys.readouterr().err


@pytest.mark.parametrize('suffix', ['csv', 'parquet'])
@pytest.mark.parametrize(
    ('heads', 'maps', 'x1'),
    [
        (['t', 'cv', 'x1', 'x1'], ['x1=#3'], 200.0),
        (['t', 'cv', 'x1', 'x1'], ['x1=#4[%]'], 3.0),
        (['t', 'cv', 'x1', 'x1 [%]'], ['x1=x1'], 200.0),
        (['t', 'cv', 'x1', 'x1 [%]'], ['x1=x1[%]'], 3.0),
        (['t', 'cv', 'x1', 'x1 [%]'], ['x1=x1 [%]'], 3.0),
        (['t', 'cv', 'x1', 'x1.1'], ['x1=x1.1'], 300.0),
        (['t', 'cv', 'X', 'X_norm'], ['x1=X_norm'], 300.0),
        (['t', 'cv', 'X', 'x1'], ['ps=X'], 300.0),  # a column that is spoken for
        (['t', 'cv', 'x1', 'y', 'y'], [], 200.0),  # of no signal
        (['t', 'cv', 'x1', 'x10', 'x1_set'], [], 200.0),
        (['t', 'cv', '#2', 'y'], ['x1=#2'], 200.0),  # a header counts before a place
    ],
)
def test_the_user_says_which_is_meant(heads, maps, x1, suffix, tmp_path):
    columns = read(table(tmp_path / f'a.{suffix}', heads), *maps)
    assert columns['x1'].tolist() == pytest.approx([x1] * ROWS)
    assert columns['cv'].tolist() == [100.0] * ROWS
    assert columns['stamp'].tolist() == (np.arange(ROWS) * 500_000_000).tolist()


def test_a_doubled_time_is_chosen_by_its_place(tmp_path):
    path = table(tmp_path / 'a.csv', ['t', 'cv', 'x1', 't'])
    assert read(path, 't=#1')['stamp'][1] == 500_000_000
    path = table(tmp_path / 'b.csv', ['clock [ms]', 'cv', 'x1', 't1', 't'])
    columns = read(path, 't=clock')
    assert columns['stamp'][1] == 500_000  # its header says the unit


def test_a_tag_without_an_addition_counts_before_one_with(tmp_path):
    heads = ['t', 'LC51_03CV', 'LC51_03X', 'P51_05_alarm', 'P51_05']
    columns = read(table(tmp_path / 'a.csv', heads))
    assert columns['p1'].tolist() == [400e3] * ROWS


def test_a_column_that_the_user_names_counts_before_a_tag(tmp_path):
    heads = ['t', 'LC51_03CV', 'LC51_03X', 'P51_05', 'INLET']
    columns = read(table(tmp_path / 'a.csv', heads), 'p1=INLET[bar]', actuator=1)
    assert columns['p1'].tolist() == [400e5] * ROWS


@pytest.mark.parametrize(
    ('maps', 'reason'),
    [
        (['cv=SP', 'x1=POS', 'x1=Y'], "x1=Y: x1 has a source, 'POS'"),
        (['cv=SP', 'x1=POS', 'x1=POS'], "x1=POS: x1 has a source, 'POS'"),
        (['t=A', 'stamp=B', 'cv=SP', 'x1=POS'], "stamp=B: t has a source, 'A'"),
        (['cv=SP', 'x1=SP[%]'], "x1=SP\\[%\\]: cv is 'SP', too"),
    ],
)
def test_a_signal_has_one_source_and_a_source_one_signal(maps, reason, capsys):
    with pytest.raises(BagError, match=reason):
        parse_maps(maps)
    words = [word for text in maps for word in ('--map', text)]
    assert main(['none.csv', *words]) == 1
    assert 'a source' in capsys.readouterr().err


@pytest.mark.parametrize('maps', [['cv=SP', 'x1=sp'], ['cv=SP', 'x1=#2'], ['t=SP', 'x1=#2']])
def test_one_column_by_two_names_is_no_two_signals(maps, tmp_path):
    path = table(tmp_path / 'a.csv', ['t', 'SP', 'x1', 'cv'])
    with pytest.raises(BagError, match="are both 'SP'"):
        read(path, *maps)


@needs_messages
@pytest.mark.parametrize(
    ('maps', 'reason'),
    [
        (['cv=/measurement.cv', 'x1=measurement.cv'], 'cv and x1 are both measurement.cv'),
        (
            ['cv=/measurement.cv', 'x1=/measurement.x1', 't=/measurement.t1'],
            'in a bag the time is that of the messages',
        ),
        (
            ['cv=/measurement.cv', 'x1=/measurement.x1', 'stamp=/measurement.t1'],
            'in a bag the time is that of the messages',
        ),
    ],
)
def test_one_field_is_no_two_signals_and_no_clock(maps, reason, tmp_path):
    made = simulated(100)
    write_columns(tmp_path / 'a.mcap', {n: made[n] for n in ('stamp', *SIGNALS) if n in made})
    with pytest.raises(BagError, match=reason):
        read(tmp_path / 'a.mcap', *maps)


IDL = 'module a { module msg { %s struct B { %s }; }; };'


@pytest.mark.parametrize(
    ('encoding', 'text', 'reason'),
    [
        ('ros2msg', 'float64 x1\nfloat64 x1\n', 'two fields of one name in a/msg/B'),
        ('ros2msg', f'C c\n{"=" * 80}\nMSG: a/C\nint8 x\nint64 x\n', 'one name in a/msg/C'),
        (
            'ros2msg',
            f'C c\n{"=" * 80}\nMSG: a/C\nfloat64 x\n{"=" * 80}\nMSG: a/C\nfloat64 y\n',
            'defines a/C twice, and differently',
        ),
        ('ros2idl', IDL % ('', 'double x1; double x1;'), 'two fields of one name in a/msg/B'),
        (
            'ros2idl',
            IDL % ('struct C { double x; }; struct C { double y; };', 'C c;'),
            'a/msg/C twice, and differently',
        ),
    ],
)
def test_a_schema_with_two_fields_of_one_name_gives_none_of_them(encoding, text, reason, tmp_path):
    with (tmp_path / 'a.mcap').open('wb') as stream:
        writer = McapWriter(stream)
        schema = writer.add_schema('a/msg/B', encoding, text.encode())
        channel = writer.add_channel(schema, '/b', 'cdr', {})
        writer.add_message(channel, struct.pack('<4sdd', b'\0\1\0\0', 0.25, 0.75), 1, 1)
        writer.finish()
    with pytest.raises(BagError, match=reason):
        read_columns(tmp_path / 'a.mcap', '/b')
