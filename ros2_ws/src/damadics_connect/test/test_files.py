"""Files that grow: whole lines, replaced files, times, and what is left out."""

import math
from zoneinfo import ZoneInfo

import pyarrow as pa
import pytest
from damadics_connect.files.follow import Folder, FollowError, GrowingCsv
from damadics_connect.files.source import Files, Stamps
from damadics_connect.publishing import look_for_zeros
from damadics_connect.valve_list import Signal, ValveSource
from damadics_fd.bag.mapping import Scale
from pyarrow import parquet


class Kept:
    def __init__(self):
        self.rows, self.samples, self.zero = [], 0, set()

    def send(self, valve, stamp, values):
        self.rows.append((stamp, values))
        look_for_zeros(self.zero, 'lv1', values)

    def flush(self):
        pass


def test_a_line_counts_once_it_has_its_end(tmp_path):
    path = tmp_path / 'a.csv'
    table = GrowingCsv(path, from_end=False)
    assert list(table.rows()) == []
    path.write_bytes('\ufefft;SP [%];POS\r\n1,5;50;\r\n2,'.encode())
    assert list(table.rows()) == [{'t': '1,5', 'SP [%]': '50', 'POS': ''}]
    with path.open('ab') as file:
        file.write(b'5;51;3\nt;SP [%];POS\n')
    assert list(table.rows()) == [{'t': '2,5', 'SP [%]': '51', 'POS': '3'}]
    path.write_bytes(b't;x\n9;1\n')  # a new export in its place
    assert list(table.rows()) == [{'t': '9', 'x': '1'}]


def test_from_the_end_leaves_out_what_is_there_but_no_half_line(tmp_path):
    path = tmp_path / 'a.csv'
    path.write_text('t,x\n1,1\n2,2\n3,')
    table = GrowingCsv(path, from_end=True)
    assert list(table.rows()) == []
    with path.open('a') as file:
        file.write('3\n4,4\n')
    assert [row['x'] for row in table.rows()] == ['3', '4']


def test_two_columns_of_one_name_are_nobodys(tmp_path):
    (tmp_path / 'a.csv').write_text('t,x,y,x\n1,10,20,30\n')
    twice = pa.table([pa.array([n]) for n in (2, 10, 20, 30)], names=['t', 'x', 'y', 'x'])
    parquet.write_table(twice, tmp_path / 'b.parquet')
    rows = list(Folder(tmp_path, from_end=False).rows())
    assert rows == [{'t': '1', 'y': '20'}, {'t': '2', 'y': '20'}]


def test_a_folder_of_csv_and_parquet(tmp_path):
    parquet.write_table(pa.table({'t': [1.0, 2.0], 'x': [0.5, None]}), tmp_path / 'a.parquet')
    (tmp_path / 'b.csv').write_text('t,x\n3,0.7\n')
    (tmp_path / 'c.parquet').write_bytes(b'PAR1 not whole yet')
    folder = Folder(tmp_path, from_end=False)
    wanted = [{'t': '1.0', 'x': '0.5'}, {'t': '2.0', 'x': ''}, {'t': '3', 'x': '0.7'}]
    assert list(folder.rows()) == wanted
    parquet.write_table(pa.table({'t': [4], 'x': [1]}), tmp_path / 'c.parquet')
    assert list(folder.rows()) == [{'t': '4', 'x': '1'}]
    with pytest.raises(FollowError, match='does not exist'):
        list(Folder(tmp_path / 'no', from_end=False).rows())


def test_the_hour_that_comes_twice_is_told_apart():
    stamps = Stamps('t', 'iso', ZoneInfo('Europe/Warsaw'))
    texts = ['2026-10-25 02:30:00', '2026-10-25 02:59:00', '2026-10-25 02:00:00']
    got = [stamps.of({'t': text}) // 10**9 for text in [*texts, '2026-10-25 03:00:00']]
    assert [b - a for a, b in zip(got, got[1:], strict=False)] == [29 * 60, 60, 3600]
    with pytest.raises(ValueError, match='no time zone'):
        Stamps('t', 'iso', None).of({'t': texts[0]})


@pytest.mark.parametrize(
    'unit, text, ns',
    [('s', '1.000000001', 1_000_000_001), ('ms', '12,5', 12_500_000), ('ns', '17', 17)],
)
def test_numbers_keep_every_nanosecond(unit, text, ns):
    assert Stamps('t', unit, None).of({'t': text}) == ns


def test_rows_become_samples_and_what_is_left_out_is_not_measured(tmp_path):
    path = tmp_path / 'a.csv'
    rows = ['t,SP,POS,P1', '1,50,40,0', '2,,41,bad', 'x,1,1,1', '3,52,42', '3,52,42,7']
    path.write_text('\n'.join(rows) + '\n')
    kept, told = Kept(), []
    signals = (
        Signal(0, 'SP', Scale(0.01)),
        Signal(1, 'POS', Scale(0.01)),
        Signal(2, 'P1', Scale()),
    )
    valve = ValveSource('lv1', 'LV-1', 1.0, signals, str(path))
    files = Files([valve], tmp_path, False, lambda: Stamps('t', 's', None), kept, told.append)
    for row in files._followed[path].rows():
        files._take(path, row)
    assert [stamp // 10**9 for stamp, _ in kept.rows] == [1, 2, 3]
    first, second = kept.rows[0][1], kept.rows[1][1]
    assert first[:3] == [0.5, 0.4, 0.0] and math.isnan(first[6])
    assert math.isnan(second[0]) and second[1] == pytest.approx(0.41) and math.isnan(second[2])
    assert told == ['a.csv: row left out: t is not a number in s']


def test_pressures_of_exactly_zero_are_told():
    zero = set()
    look_for_zeros(zero, 'lv1', [0.5, 0.5, 0.0, 0.0, 20.0, 0.0, 0.0])
    assert zero == {'lv1'}
    look_for_zeros(zero, 'lv1', [0.5, 0.5, 0.0, 0.0, 20.0, 0.0, math.nan])
    assert zero == set()
