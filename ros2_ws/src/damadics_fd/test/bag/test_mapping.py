# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What people write behind `--map`: names, units, factors, offsets, inversion."""

import numpy as np
import pytest
from damadics_fd.bag import BagError
from damadics_fd.bag.mapping import Scale, Source, parse_maps, parse_source, units_of

pytestmark = pytest.mark.plain


def test_maps_name_signal_source_and_factor():
    assert parse_maps(['x1=/a/b.c.d*1e-2', 'cv=CV']) == {
        'x1': Source('/a/b.c.d', Scale(0.01)),
        'cv': Source('CV'),
    }


@pytest.mark.parametrize(
    ('text', 'name', 'raw', 'value'),
    [
        ('cv=POS[%]', 'POS', 30.0, 0.3),
        ('cv=POS[%] invert', 'POS', 30.0, 0.7),
        ('cv=POS [%],invert', 'POS', 30.0, 0.7),
        ('cv=SP*-0.01+1', 'SP', 30.0, 0.7),
        ('cv=/valve/sp.data * -1e-2 + 1.0', '/valve/sp.data', 30.0, 0.7),
        ('x1=I[mA]', 'I', 12.0, 0.5),
        ('x1=I[mA] invert', 'I', 4.0, 1.0),
        ('x1=U[V]', 'U', 5.0, 0.5),
        ('ps=PS[bar]', 'PS', 2.0, 2e5),
        ('ps=PS[bar_a]', 'PS', 1.01325, 0.0),
        ('p1=P[kPa]', 'P', 3.0, 3000.0),
        ('p1=P[psi]', 'P', 1.0, 6894.757293168),
        ('t1=T[K]', 'T', 300.0, 26.85),
        ('t1=T[degF]', 'T', 212.0, 100.0),
        ('flow=F[t/h]', 'F', 3.6, 1.0),
        ('x1=LV-101', 'LV-101', 0.4, 0.4),
        ('x1=LV-101*0.01', 'LV-101', 40.0, 0.4),
        ('x1=/j.position[3]', '/j.position[3]', 0.4, 0.4),
        ('x1=A/B[%]*2+0.1', 'A/B', 10.0, 0.3),
        ('x1=X+0.5', 'X', 0.25, 0.75),
    ],
)
def test_sources_with_units_factor_offset_and_inversion(text, name, raw, value):
    (source,) = parse_maps([text]).values()
    assert source.name == name
    assert source.scale(raw) == pytest.approx(value)
    assert source.scale(np.array([raw])) == pytest.approx([value])


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('speed=/a.b', 'SIGNAL is one of'),
        ('x1', 'SIGNAL is one of'),
        ('x1=', 'SIGNAL is one of'),
        ('x1=A*', 'write SIGNAL='),
        ('x1=A*b', 'write SIGNAL='),
        ('x1=A[bar]', r'x1 cannot be in \[bar\]; it may be in %'),
        ('ps=A[%]', 'Pa, Pa_g'),
        ('ps=A invert', 'only cv and x1 can be inverted'),
    ],
)
def test_what_is_no_source_is_refused_with_a_remedy(text, reason):
    with pytest.raises(BagError, match=reason):
        parse_maps([text])


def test_units_are_found_whatever_their_case():
    assert parse_source('ps', 'A[BAR]').scale.factor == 1e5
    assert parse_source('ps', 'A[mPa]').scale.factor == 1e6
    assert set(units_of('cv')) == set(units_of('x1'))


def test_the_names_of_the_signals_are_those_of_the_monitor():
    from damadics_fd.bag.mapping import SIGNALS
    from damadics_fd.core import sample

    assert SIGNALS == sample.SIGNALS
