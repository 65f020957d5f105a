# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.signature import Signature
from damadics_fd.core.valve.plug import recoveries
from damadics_fd.figures import valve_signature
from damadics_fd.figures.valve_signature import ForceMap, force_over_position

from ..signature.feed import feed

C = SignatureSettings()


def rows(seconds: float) -> np.ndarray:
    """A stem that goes to and fro; force = K x1 + friction of 25 N."""
    n = round(seconds / C.sample_period)
    out = np.zeros(n, np.dtype([('stamp', 'i8'), ('x1', 'f8'), ('ps', 'f8'), ('dp', 'f8')]))
    t = np.arange(n) * C.sample_period
    out['stamp'] = np.arange(n) * 5_000_000
    out['x1'] = 0.5 + 0.4 * np.sin(0.4 * t)
    out['dp'] = 9e5
    force = C.force_scale * (out['x1'] + C.preload) + 25.0 * np.sign(np.cos(0.4 * t))
    plug = out['dp'] * C.plug_area / recoveries(C.plug_km, out['x1'])
    out['ps'] = (force + plug - C.weight) / C.diaphragm_area
    return out


def test_blocks_do_not_depend_on_the_pieces_and_hold_the_force():
    data = rows(60.0)
    whole, pieces = ForceMap(Signature(C)), ForceMap(Signature(C))
    whole.add(data)
    for first in range(0, len(data), 777):
        pieces.add(data[first : first + 777])
    for a, b in zip(whole.moving(), pieces.moving(), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)
    _, x, force, _, v = whole.moving()
    friction = force - C.force_scale * (x + C.preload)
    assert len(x) > 300
    np.testing.assert_allclose(friction, 25.0 * np.sign(v), atol=0.5)


def test_blocks_of_long_recordings_stay_few_with_the_first_and_the_latest(monkeypatch):
    monkeypatch.setattr(valve_signature, 'MOST_BLOCKS', 400)
    data, force_map = rows(200.0), ForceMap(Signature(C))
    for first in range(0, len(data), 777):
        force_map.add(data[first : first + 777])
    t, *_ = force_map.moving()
    assert 100 < len(t) <= 400
    assert t[0] < 1.0
    assert (t > 185.0).sum() > 100


def test_picture_is_written_and_nothing_learned_is_refused(tmp_path):
    pytest.importorskip('matplotlib')
    data, signature = rows(150.0), Signature(C)
    force_map = ForceMap(signature)
    with pytest.raises(RuntimeError, match='no signature has been learned'):
        force_over_position(force_map, signature, tmp_path / 'a.png', 'V')
    feed(signature, *(data[name] for name in ('stamp', 'x1', 'ps', 'dp')))
    force_map.add(data)
    path = force_over_position(force_map, signature, tmp_path / 'new' / 'a.png', 'V')
    assert path.read_bytes()[:4] == b'\x89PNG' and path.stat().st_size > 20_000
