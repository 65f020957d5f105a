# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Records: layout, compiled use, saved data."""

import math
from typing import Annotated

import numpy as np
import pytest
from damadics_fd.core.jit import jit
from damadics_fd.core.record import Floats, Ints, Record, Rows

pytestmark = pytest.mark.plain


class Filter(Record):
    a: Annotated[Floats, 3]
    gain: float


class Counts(Record):
    seen: int
    ready: bool
    base: float  # numpy has attributes of these names
    mean: Annotated[Floats, 2]


class Memory(Counts, Filter):
    matrix: Annotated[Floats, 2, 3]
    last: Annotated[Ints, 4]
    main: Filter
    pair: Annotated[Rows[Filter], 2]


@jit
def _step(m: Memory, x: float) -> float:
    m.seen += 1
    m.a[1] = x
    m.pair[1].gain = x * x
    m.main.gain = 2.0 * x
    m.ready = True
    m.base += x
    return m.matrix[1, 2] + m.gain


@jit
def _update(m: Rows[Memory], x: float) -> float:
    return _step(m[0], x)


def _filled():
    rows = Memory.rows()
    rows['matrix'][0] = np.arange(6.0).reshape(2, 3)
    rows['pair'][0]['a'] = np.arange(6.0).reshape(2, 3)
    rows['seen'] = 2**62
    return rows


def test_the_layout_follows_the_declaration():
    assert Memory.names() == (
        *('seen', 'ready', 'base', 'mean', 'a', 'gain'),  # of the bases, in their order
        *('matrix', 'last', 'main', 'pair'),
    )
    dtype = Memory.dtype()
    assert dtype['matrix'].shape == (2, 3)
    assert dtype['seen'] == np.int64
    assert dtype['ready'] == np.bool_
    assert dtype['pair'].base == Filter.dtype()
    assert all(dtype.fields[name][1] % dtype[name].alignment == 0 for name in dtype.names)


def test_compiled_code_writes_the_record_it_is_given():
    rows = _filled()
    rows['gain'] = 0.5
    assert _update(rows, 3.0) == 5.5
    record = rows[0]
    assert (record.seen, record.a[1], record.ready) == (2**62 + 1, 3.0, True)
    assert (record.main.gain, rows['pair'][0, 1]['gain']) == (6.0, 9.0)
    record = Memory.new()
    _step(record, 1.0)
    assert record.seen == 1


@pytest.mark.parametrize('base', [_step, getattr(_step, 'py_func', _step)])
def test_fields_hide_the_attributes_of_numpy(base):
    rows = _filled()
    rows['base'], rows['mean'] = 1.5, (2.0, 3.0)
    base(rows[0], 4.0)
    record = rows[0]
    assert (record.base, record.mean.tolist(), record.main.gain) == (5.5, [2.0, 3.0], 8.0)


def test_plain_data_brings_the_record_back():
    rows = _filled()
    plain = Memory.plain(rows)
    assert plain['pair_a'] == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]
    assert Memory.read(plain, 'memory').tobytes() == rows.tobytes()
    some = Memory.read({'seen': 3, 'gain': 1}, 'memory', ('seen', 'gain'))
    assert (some[0].seen, some[0].gain, some[0].ready) == (3, 1.0, False)


@pytest.mark.parametrize(
    ('name', 'value', 'text'),
    [
        ('gain', math.nan, 'memory: gain = nan is not finite'),
        ('gain', '1.5', "gain = '1.5' does not fit"),
        ('gain', None, 'does not fit'),
        ('gain', True, 'does not fit'),
        ('seen', 1.5, 'whole numbers'),
        ('seen', 2**63, 'too large'),
        ('seen', 2**80, 'whole numbers'),
        ('ready', 1, 'true or false'),
        ('a', [1.0, 2.0], 'of the shape (3,)'),
        ('a', [1.0, [2.0], 3.0], 'does not fit'),
        ('a', {'x': 1}, 'does not fit'),
        ('pair_gain', [1.0, math.inf], 'is not finite'),
    ],
)
def test_what_does_not_fit_is_named(name, value, text):
    plain = Memory.plain(Memory.rows()) | {name: value}
    with pytest.raises(ValueError, match=f'memory: {name}') as error:
        Memory.read(plain, 'memory')
    assert text in str(error.value)


def test_missing_and_unknown_fields_are_named():
    plain = Memory.plain(Memory.rows())
    del plain['gain']
    with pytest.raises(ValueError, match='memory: extra, gain missing or unknown'):
        Memory.read(plain | {'extra': 1.0}, 'memory')
