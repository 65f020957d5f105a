# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What stands in the cells of other people's tables where a number should be."""

import numpy as np
import pytest
from damadics_fd.bag import BagError

from .table_support import CV, PLAIN, STAMP, VALUES, N, cell, columns_of, iso

pytestmark = pytest.mark.plain


@pytest.mark.parametrize(
    'text',
    ['#DIV/0!', '#VALUE!', '-nan(ind)', '1.#QNAN', '1.#INF', '(null)', '\\N', 'Shutdown', '*']
    + ['Comm Fail', 'Tag not found', '[-11059] No Good Data For Calculation', 'n.a.', '<NA>'],
)
@pytest.mark.parametrize('suffix', ['csv', 'parquet'])
def test_what_programs_write_for_no_value_is_not_measured(text, suffix, tmp_path):
    path = tmp_path / f'a.{suffix}'
    ps = [text if i % 10 == 5 else cell(VALUES['ps'][i]) for i in range(N)]
    if suffix == 'parquet':
        pa = pytest.importorskip('pyarrow')
        from pyarrow import parquet

        parquet.write_table(pa.table({'stamp': STAMP, **VALUES, 'ps': ps}), path)
    else:
        lines = [f'{iso(STAMP[i])},{cell(CV[i])},{cell(CV[i] / 2)},{ps[i]}' for i in range(N)]
        path.write_text('\n'.join([PLAIN, *lines]))
    wanted = np.where(np.arange(N) % 10 == 5, np.nan, VALUES['ps'])
    columns = columns_of(path)
    assert np.array_equal(columns['ps'], wanted, equal_nan=True)
    assert columns['x1'].tolist() == VALUES['x1'].tolist()


def test_a_minus_of_typesetters_is_a_minus_and_a_digit_is_no_name(tmp_path):
    lines = [f'{iso(STAMP[i])},{cell(CV[i])},{cell(CV[i])},\u2212{i}' for i in range(N)]
    (tmp_path / 'a.csv').write_text('\n'.join(['t,cv,x1,t1', *lines]), encoding='utf-8')
    assert columns_of(tmp_path / 'a.csv')['t1'].tolist() == (-1.0 * np.arange(N)).tolist()
    (tmp_path / 'a.csv').write_text('\n'.join(['t,cv,x1,t1', *lines]).replace('\u2212', '1_'))
    with pytest.raises(BagError, match='is no row of numbers'):
        columns_of(tmp_path / 'a.csv')


def test_rows_without_a_time_leave_the_others_exact(tmp_path):
    pa = pytest.importorskip('pyarrow')
    from pyarrow import parquet

    time = pa.array([None if i == 7 else int(STAMP[i]) + 1 for i in range(N)], pa.timestamp('ns'))
    parquet.write_table(pa.table({'time': time, **VALUES}), tmp_path / 'a.parquet')
    told: list[str] = []
    columns = columns_of(tmp_path / 'a.parquet', problems=told)
    assert columns['stamp'].tolist() == np.delete(STAMP + 1, 7).tolist()
    assert columns['x1'].tolist() == np.delete(VALUES['x1'], 7).tolist()
    assert told == [
        f'{tmp_path / "a.parquet"}: 1 rows up to row {N} have no time and are left out'
    ]


def test_a_column_without_numbers_is_named(tmp_path):
    pa = pytest.importorskip('pyarrow')
    from pyarrow import parquet

    parquet.write_table(
        pa.table({'stamp': STAMP, **VALUES, 'x1': [[x] for x in CV]}), tmp_path / 'a.parquet'
    )
    with pytest.raises(BagError, match='the column x1 holds no numbers: list'):
        columns_of(tmp_path / 'a.parquet')


@pytest.mark.parametrize('header', ['x1 [mm]', 'x1 (in)', 'x1 [kPa]', 'p1 [atm]', 'ps [mmHg]'])
def test_a_unit_that_is_not_known_is_no_si_unit(header, tmp_path):
    names = {'x1': 'x1', 'p1': 'p1', 'ps': 'ps'} | {header.split()[0]: header}
    lines = [f'{iso(STAMP[i])},{cell(CV[i])},{cell(CV[i] / 2)},1,2' for i in range(N)]
    path = tmp_path / 'a.csv'
    path.write_text('\n'.join([f't,cv,{names["x1"]},{names["p1"]},{names["ps"]}', *lines]))
    signal, place = header.split()[0], 3 + list(names).index(header.split()[0])
    with pytest.raises(BagError, match=r'is not known; write --map .*#PLACE\*FACTOR') as refused:
        columns_of(path)
    assert header in str(refused.value)
    mapped = columns_of(path, f'{signal}=#{place}*0.02')
    plain = {'x1': CV / 2, 'p1': np.full(N, 1.0), 'ps': np.full(N, 2.0)}[signal]
    assert np.allclose(mapped[signal], 0.02 * plain)


@pytest.mark.parametrize('unit', ['-', '1', '0..1', '%'])
def test_a_share_has_its_unit_or_none(unit, tmp_path):
    factor = 100 if unit == '%' else 1
    lines = [f'{iso(STAMP[i])},{cell(CV[i])},{cell(factor * CV[i] / 2)}' for i in range(N)]
    (tmp_path / 'a.csv').write_text('\n'.join([f't,cv,x1 [{unit}]', *lines]))
    assert np.allclose(columns_of(tmp_path / 'a.csv')['x1'], CV / 2, atol=1e-9)


@pytest.mark.parametrize('head', ['stamp,time', 't,timestamp', 'date,t,time', 'date,timestamp'])
def test_two_times_are_refused_until_one_is_named(head, tmp_path):
    values = {
        'stamp': lambda i: str(STAMP[i]),
        't': lambda i: str(i),
        'date': lambda i: iso(0)[:10],
    }
    names = head.split(',')
    if head == 'date,t,time':
        values['time'] = lambda i: iso(STAMP[i]).partition('T')[2]
    lines = [
        ','.join([*(values.get(n, lambda i: iso(STAMP[i]))(i) for n in names), cell(CV[i]), '0.5'])
        for i in range(N)
    ]
    (tmp_path / 'a.csv').write_text('\n'.join([f'{head},cv,x1', *lines]))
    with pytest.raises(BagError, match='t may be any of'):
        columns_of(tmp_path / 'a.csv')
    place = len(names) if head != 'date,t,time' else 2
    assert len(columns_of(tmp_path / 'a.csv', f't=#{place}')['stamp']) == N
