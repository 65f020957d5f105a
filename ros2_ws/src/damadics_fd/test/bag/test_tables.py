# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Tables as people have them: spreadsheets, pandas, historians, Parquet."""

import csv
import json
from datetime import UTC, datetime

import numpy as np
import pytest
from damadics_fd.bag import BagError
from damadics_fd.commands.replay.replay import main

from .table_support import CV, PLAIN, STAMP, START, VALUES, N, cell, columns_of, iso, rows

pytestmark = pytest.mark.plain


def german(i: int) -> str:
    seconds, rest = divmod(int(STAMP[i]), 10**9)
    text = datetime.fromtimestamp(seconds, UTC).strftime('%d.%m.%Y %H:%M:%S')
    return f'{text},{rest // 10**6:03d}'


def american(i: int) -> str:
    seconds, rest = divmod(int(STAMP[i]), 10**9)
    text = datetime.fromtimestamp(seconds, UTC).strftime('%m/%d/%Y %I:%M:%S')
    return f'{text}.{rest // 10**6:03d} PM'


def pi_historian(i: int) -> str:
    seconds, rest = divmod(int(STAMP[i]), 10**9)
    text = datetime.fromtimestamp(seconds, UTC).strftime('%d-%b-%y %H:%M:%S')
    return f'{text}.{rest // 10**6:03d}'


def clock(i: int) -> str:
    seconds, rest = divmod(int(STAMP[i]), 10**9)
    return datetime.fromtimestamp(seconds, UTC).strftime('%H:%M:%S') + f'.{rest // 10**6:03d}'


def basic(i: int) -> str:
    seconds, rest = divmod(int(STAMP[i]), 10**9)
    text = datetime.fromtimestamp(seconds, UTC).strftime('%Y%m%dT%H%M%S')
    return f'{text}.{rest // 10**6:03d}Z'


DATED = {
    'seconds since 1970': rows('time,cv,x1,ps', lambda i: repr(float(STAMP[i] / 1e9))),
    'milliseconds since 1970': rows('timestamp,cv,x1,ps', lambda i: str(STAMP[i] // 10**6)),
    'nanoseconds since 1970': rows('timestamp,cv,x1,ps', lambda i: str(STAMP[i])),
    'ISO without zone': rows(PLAIN, lambda i: iso(STAMP[i])),
    'ISO, UTC': rows(PLAIN, lambda i: iso(STAMP[i], 'Z')),
    'ISO with zone': rows(PLAIN, lambda i: iso(STAMP[i], '+01:00', ahead=1)),
    'pandas': rows(',cv,x1,ps', lambda i: iso(STAMP[i], '+00:00', ' ')),
    'BOM': '\ufeff' + rows(PLAIN, lambda i: iso(STAMP[i])),
    'German spreadsheet': '\ufeff' + rows('Zeit;cv;x1;ps', german, ';', ','),
    'American spreadsheet': rows('Date Time,cv,x1,ps', american),
    'historian': rows('Timestamp,cv,x1,ps', pi_historian),
    'date and time apart': rows('Date,Time,cv,x1,ps', lambda i: f'2026-11-25,{clock(i)}'),
    'preamble': 'Report: LV-101\nexported;by;me\n\n' + rows('Zeit;cv;x1;ps', german, ';', ','),
    'preamble with commas': 'LV-101, valve\n' + rows(PLAIN, lambda i: iso(STAMP[i])),
    'units in the header': rows(
        'time,cv [%],x1 [%],ps [bar]', lambda i: iso(STAMP[i]), scales=(100, 100, 1e-5)
    ),
    'units below the header': rows(
        'time,cv,x1,ps\n,%,%,kPa', lambda i: iso(STAMP[i]), scales=(100, 100, 1e-3)
    ),
    'quoted': rows('"time","cv","x1","ps"', lambda i: f'"{iso(STAMP[i])}"'),
    'ISO 8601 without signs between': rows(PLAIN, basic),
    'name of a zone': rows(PLAIN, lambda i: iso(STAMP[i], '+01:00[Europe/Berlin]', ahead=1)),
    'month first': rows(PLAIN, lambda i: f'"Nov 25, 2026 {clock(i)}"'),
    'weekday': rows(PLAIN, lambda i: f'"Wed, 25 Nov 2026 {clock(i)}"'),
    'units behind a slash': rows(
        't/s,cv/%,x1 / %,ps/bar', lambda i: repr(float(STAMP[i] / 1e9)), scales=(100, 100, 1e-5)
    ),
    'capitals': rows('Time,CV,X1,PS', lambda i: iso(STAMP[i])),
    'milliseconds by name': rows('time_ms,cv,x1,ps', lambda i: str(STAMP[i] // 10**6)),
    'tabs': rows('time\tcv\tx1\tps', lambda i: iso(STAMP[i]), '\t'),
    'blanks': rows('  time  cv x1   ps', lambda i: f'   {STAMP[i] / 1e9:.16e}', '   '),
    'signs of percent': '\n'.join(
        [
            'time,cv,x1,ps',
            *(
                f'{iso(STAMP[i])},{100 * CV[i]} %,{50 * CV[i]}%,{1e5 + 1e5 * CV[i]}'
                for i in range(N)
            ),
        ]
    ),
    'thousands parted by apostrophes': '\n'.join(
        [
            'time;cv;x1;ps',
            *(
                f'{iso(STAMP[i])};{CV[i]};{CV[i] / 2};{1e5 + 1e5 * CV[i]:_.9f}'.replace('_', "'")
                for i in range(N)
            ),
        ]
    ),
    'a delimiter ends each line': rows(PLAIN, lambda i: iso(STAMP[i])).replace('\n', ',\n'),
    'a delimiter ends each line but the header': rows(PLAIN, lambda i: iso(STAMP[i]))
    .replace('\n', ',\n')
    .replace('ps,', 'ps', 1),
    'exponents of Fortran': '\n'.join(
        [PLAIN]
        + [
            f'{iso(STAMP[i])},{cell(CV[i])}D0,{cell(CV[i] * 50)}d-02,{cell(VALUES["ps"][i])}'
            for i in range(N)
        ]
    ),
    'blanks and tabs': rows('% time \t cv \t x1 \t ps', lambda i: f' {iso(STAMP[i])}', ' \t '),
}


@pytest.mark.parametrize('kind', DATED)
def test_tables_as_people_have_them_give_the_same_samples(kind, tmp_path):
    (tmp_path / 'a.csv').write_text(DATED[kind], encoding='utf-8')
    columns = columns_of(tmp_path / 'a.csv')
    assert np.abs(columns['stamp'] - STAMP).max() < 1000  # [ns] what a double holds of a date
    for name, values in VALUES.items():
        assert columns[name] == pytest.approx(values, rel=1e-12)


@pytest.mark.parametrize('encoding', ['utf-16', 'cp1252', 'utf-8-sig'])
def test_spreadsheets_of_windows_are_read_in_their_encoding(encoding, tmp_path):
    text = rows('Zeit;Sollwert für Ventil [%];Stellung °;ps', german, ';', ',')
    (tmp_path / 'a.csv').write_text(text, encoding=encoding)
    maps = ('t=Zeit', 'cv=Sollwert für Ventil*1', 'x1=Stellung °')
    columns = columns_of(tmp_path / 'a.csv', *maps)
    assert columns['cv'] == pytest.approx(VALUES['cv'])
    assert columns['x1'] == pytest.approx(VALUES['x1'])


@pytest.mark.parametrize(
    ('head', 'scales', 'maps'),
    [
        ('T,SP,POS,P', (100, 100, 1e-5), ['cv=SP[%]', 'x1=POS[%]', 'ps=P[bar]']),
        ('T,SP [%],POS [%],P [bar]', (100, 100, 1e-5), ['cv=SP', 'x1=POS', 'ps=P']),
        ('T,SP [%],POS [%],P [bar]', (100, 100, 1e-5), ['cv=SP[%]', 'x1=POS[%]', 'ps=P[bar]']),
        ('T,SP,POS,P', (16, 1, 1), ['cv=SP*0.0625+0', 'x1=POS', 'ps=P']),
    ],
)
def test_columns_are_mapped_with_units_and_factors(head, scales, maps, tmp_path):
    text = rows(head, lambda i: str(i * 5), scales=scales)
    (tmp_path / 'a.csv').write_text(text)
    columns = columns_of(tmp_path / 'a.csv', 't=T[ms]', *maps)
    assert columns['stamp'].tolist() == (np.arange(N) * 5_000_000).tolist()
    for name, values in VALUES.items():
        assert columns[name] == pytest.approx(values)


def test_opening_percent_and_milliamperes_become_closed_shares(tmp_path):
    lines = ['t,SP,I'] + [f'{i * 0.005},{100 - 100 * CV[i]},{20 - 16 * CV[i]}' for i in range(N)]
    (tmp_path / 'a.csv').write_text('\n'.join(lines))
    columns = columns_of(tmp_path / 'a.csv', 'cv=SP[%] invert', 'x1=I[mA] invert')
    assert columns['cv'] == pytest.approx(CV)
    assert columns['x1'] == pytest.approx(CV)


def test_times_of_day_count_on_over_midnight(tmp_path):
    begin = 86_399 * 10**9 + 900_000_000
    times = [divmod(begin + i * 5_000_000, 10**9) for i in range(N)]

    def text(i: int) -> str:
        second, rest = times[i]
        hour, minute = second // 3600 % 24, second // 60 % 60
        return f'{hour:02d}:{minute:02d}:{second % 60:02d}.{rest // 10**6:03d}'

    (tmp_path / 'a.csv').write_text(rows(PLAIN, text))
    assert text(0) > text(N - 1)
    assert columns_of(tmp_path / 'a.csv')['stamp'].tolist() == (begin + STAMP - START).tolist()


MIDNIGHT = START // (86_400 * 10**9) * 86_400 * 10**9


@pytest.mark.parametrize(
    'time',
    [
        'dates',
        'zoned',
        'seconds',
        'stamp',
        'text',
        'categories',
        'views',
        'duration',
        'time of day',
    ]
    + ['date and time', 'date and text', 'texts'],
)
def test_parquet_is_read_like_csv(time, tmp_path):
    pa = pytest.importorskip('pyarrow')
    from pyarrow import parquet

    texts = [iso(stamp, 'Z') for stamp in STAMP]
    days, clocks = [text[:10] for text in texts], [text[11:-1] for text in texts]
    day = pa.array(STAMP, pa.timestamp('ns')).cast(pa.date32(), safe=False)
    clock = pa.array(STAMP - MIDNIGHT, pa.time64('ns'))
    made = {
        'dates': lambda: {'time': pa.array(STAMP, pa.timestamp('ns'))},
        'zoned': lambda: {'when': pa.array(STAMP, pa.timestamp('ns', 'Europe/Berlin'))},
        'seconds': lambda: {'t': pa.array(STAMP / 1e9)},
        'stamp': lambda: {'stamp': pa.array(STAMP)},
        'text': lambda: {'time': pa.array(texts)},
        'categories': lambda: {'time': pa.array(texts).dictionary_encode()},
        'views': lambda: {'time': pa.array(texts, pa.string_view())},
        'duration': lambda: {'time': pa.array(STAMP - MIDNIGHT, pa.duration('ns'))},
        'time of day': lambda: {'time': clock},
        'date and time': lambda: {'date': day, 'time': clock},
        'date and text': lambda: {'date': day, 'time': pa.array(clocks)},
        'texts': lambda: {'date': pa.array(days), 'time': pa.array(clocks)},
    }
    parquet.write_table(pa.table({**made[time](), **VALUES}), tmp_path / 'a.parquet')
    columns = columns_of(tmp_path / 'a.parquet')
    first = MIDNIGHT if time in ('duration', 'time of day') else 0
    assert np.abs(columns['stamp'] + first - STAMP).max() < 1000
    assert columns['x1'].tolist() == VALUES['x1'].tolist()


@pytest.mark.parametrize(
    ('name', 'content', 'reason'),
    [
        ('a.parquet', b'PAR1 and nonsense', 'cannot be read as Parquet'),
        ('a.csv', b'\0\1\2\3' * 100, 'it is binary'),
        ('a.csv', rows(PLAIN, lambda i: '03/04/2026 10:00:00').encode(), 'cannot be told apart'),
        ('a.csv', rows('t,a,b,c', str).encode(), 'it has the columns t, a, b, c'),
        ('a.csv', b'\xef\xbb\xbfwhen,cv,x1\nnoon,1,2\n', 'lacks a time'),
    ],
)
def test_what_cannot_be_read_is_told_with_a_remedy(name, content, reason, tmp_path, capsys):
    (tmp_path / name).write_bytes(content)
    assert main([str(tmp_path / name), '--mode', 'paper']) == 1
    assert reason in capsys.readouterr().err


def test_a_missing_column_is_named_with_those_there_are(tmp_path):
    (tmp_path / 'a.csv').write_text('\ufeff' + rows('Zeit,A [%],B,C', str), encoding='utf-8')
    with pytest.raises(BagError, match=r'there is no such column; there are Zeit, A \[%\], B, C'):
        columns_of(tmp_path / 'a.csv', 't=Zeit', 'cv=Z', 'x1=B')


def test_an_absurd_time_is_left_out_without_a_word_of_numpy(tmp_path):
    text = rows(PLAIN, lambda i: '1e300' if i == 7 else str(i * 0.005))
    (tmp_path / 'a.csv').write_text(text)
    told: list[str] = []
    assert len(columns_of(tmp_path / 'a.csv', problems=told)['stamp']) == N - 1
    assert 'have no time' in told[0]


def test_results_have_one_content_in_all_formats(tmp_path):
    parquet = pytest.importorskip('pyarrow.parquet')
    good = rows(PLAIN, lambda i: str(i * 0.005))
    (tmp_path / 'in').mkdir()
    (tmp_path / 'in' / 'learning.csv').write_text(good)
    (tmp_path / 'in' / 'refused.csv').write_text(rows(PLAIN, lambda i: '5'))
    for suffix in ('json', 'csv', 'parquet'):
        code = main(
            [str(tmp_path / 'in'), '--mode', 'paper', '--out', str(tmp_path / f'r.{suffix}')]
        )
        assert code == 1
    found = {base(r['bag']): r for r in json.loads((tmp_path / 'r.json').read_text())}
    assert found['refused.csv']['verdict'] == 'failed'
    assert '49 of 50 samples were refused' in found['refused.csv']['error']
    table = parquet.read_table(tmp_path / 'r.parquet').to_pylist()

    with (tmp_path / 'r.csv').open() as file:
        lines = list(csv.DictReader(file))
    for row in (*table, *lines):
        whole = found[base(row['bag'])]
        for name in ('verdict', 'status', 'error', 'mode'):
            assert row[name] == whole[name]
        assert json.loads(row['refused']) == whole['refused']
        assert json.loads(row['problems']) == whole['problems']
        assert int(row['samples']) == whole['samples']


def base(text: str) -> str:
    return text.rsplit('/', 1)[-1]
