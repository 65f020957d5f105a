# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""PR-2: what was learned survives a restart; a damaged file never half loads."""

import json
import re
from dataclasses import asdict
from pathlib import Path

import damadics_fd
import numpy as np
import pytest
import yaml
from damadics_fd.bag import rosbag2
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_fd.store import yaml_text
from damadics_fd.store.references import (
    FORMAT,
    NoReferenceError,
    Reference,
    ReferenceFileError,
    load_reference,
    save_reference,
)
from damadics_fd.store.slots import write_slot

from ..core.synthetic import valve

SETTINGS = Settings.for_mode('monitor')


@pytest.fixture(scope='module')
def learned():
    return run(valve(70.0, noise=1e-3), SETTINGS).estimator.learned()


def reference(learned, **changes):
    given = {'actuator': 'LV-101', 'learned': learned, 'settings': SETTINGS.to_dict()}
    return Reference(**{**given, **changes})


def test_restarted_estimator_goes_straight_to_monitor(tmp_path, learned):
    save_reference(tmp_path / 'LV-101', reference(learned))
    loaded = load_reference(tmp_path / 'LV-101', 'LV-101', SETTINGS)
    assert loaded.learned == learned
    estimator = Estimator(SETTINGS)
    estimator.restore(loaded.learned)
    result = run(valve(10.0, first=500.0), SETTINGS, estimator)
    phases = result.estimates['phase'].tolist()
    assert phases[:200] == [5] * 200  # the filters settle for 1 s
    assert set(phases[200:]) == {3}
    assert result.detections == []
    assert estimator.learned() == learned
    assert estimator.status == 'monitoring'


def test_the_verdict_is_kept_and_a_reference_without_one_is_read(tmp_path, learned):
    verdict = {'verdict': 'limited', 'reasons': ['p1 is a constant'], 'misfit': 0.2}
    save_reference(tmp_path / 'new', reference(learned, commissioning=verdict))
    assert load_reference(tmp_path / 'new', 'LV-101', SETTINGS).commissioning == verdict
    old = asdict(reference(learned, created=1.0))
    del old['commissioning']
    write_slot(tmp_path / 'old', FORMAT, old)
    assert load_reference(tmp_path / 'old', 'LV-101', SETTINGS).commissioning == {}
    write_slot(tmp_path / 'odd', FORMAT, old | {'more': 1})
    with pytest.raises(ReferenceFileError, match='fields are unknown'):
        load_reference(tmp_path / 'odd', 'LV-101', SETTINGS)


def test_restored_estimator_finds_the_fault(learned):
    estimator = Estimator(SETTINGS)
    estimator.restore(learned)
    result = run(valve(30.0, friction=lambda t: 0.011 * (1 + 4 * (t > 20.0))), SETTINGS, estimator)
    assert result.detections[0].stamp == pytest.approx(20e9, abs=0.2e9)


def test_saves_alternate_between_two_slots(tmp_path, learned):
    path = tmp_path / 'LV-101'
    files = [save_reference(path, reference(learned, comment=str(n))).name for n in range(4)]
    assert files == ['LV-101.a.json', 'LV-101.b.json'] * 2
    assert load_reference(path, 'LV-101', SETTINGS).comment == '3'
    assert sorted(p.name for p in tmp_path.iterdir()) == ['LV-101.a.json', 'LV-101.b.json']


def test_newest_slot_damaged_falls_back_to_the_other(tmp_path, learned):
    path = tmp_path / 'LV-101'
    save_reference(path, reference(learned, comment='old'))
    newest = save_reference(path, reference(learned, comment='new'))
    whole = newest.read_bytes()
    for cut in range(0, len(whole), 97):
        newest.write_bytes(whole[:cut])
        assert load_reference(path, 'LV-101', SETTINGS).comment == 'old'
    rng = np.random.default_rng(0)
    for position in rng.integers(0, len(whole), 100):
        damaged = bytearray(whole)
        damaged[position] ^= 1 << rng.integers(0, 8)
        newest.write_bytes(damaged)
        loaded = load_reference(path, 'LV-101', SETTINGS)
        assert loaded.comment == 'old' or loaded.learned == learned  # white space may change
    newest.unlink()
    assert load_reference(path, 'LV-101', SETTINGS).comment == 'old'


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        ({'actuator': 'LV-102'}, 'belongs to LV-102, not to LV-101'),
        ({'settings': Settings.for_mode('monitor', k2=300.0).to_dict()}, 'k2 = 400.0 was 300.0'),
    ],
)
def test_reference_of_something_else_is_refused(tmp_path, learned, change, reason):
    save_reference(tmp_path / 'x', reference(learned, **change))
    with pytest.raises(ReferenceFileError, match=reason):
        load_reference(tmp_path / 'x', 'LV-101', SETTINGS)


def test_reference_from_the_future_is_refused(tmp_path, learned):
    save_reference(tmp_path / 'x', reference(learned), now=1e9)
    assert load_reference(tmp_path / 'x', 'LV-101', SETTINGS, now=1.1e9).created == 1e9
    with pytest.raises(ReferenceFileError, match='in the future'):
        load_reference(tmp_path / 'x', 'LV-101', SETTINGS, now=0.9e9)


def test_no_reference_is_told_from_two_damaged_slots(tmp_path):
    with pytest.raises(NoReferenceError, match=r'none is kept yet in .*/x'):
        load_reference(tmp_path / 'x', 'LV-101', SETTINGS)
    (tmp_path / 'x.b.json').write_text('{')
    with pytest.raises(ReferenceFileError, match=r'x\.a\.json does not exist.*x\.b\.json') as bad:
        load_reference(tmp_path / 'x', 'LV-101', SETTINGS)
    assert not isinstance(bad.value, NoReferenceError)


def test_failed_write_keeps_what_is_there(tmp_path, learned, monkeypatch):
    path = tmp_path / 'x'
    save_reference(path, reference(learned, comment='one'))
    save_reference(path, reference(learned, comment='two'))

    def full(*_):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr('os.fsync', full)
    with pytest.raises(OSError, match='No space'):
        save_reference(path, reference(learned, comment='three'))
    assert load_reference(path, 'LV-101', SETTINGS).comment == 'two'


@pytest.mark.parametrize(
    'damage',
    [
        lambda s: s.pop('w1'),
        lambda s: s.update(w3=[1.0]),
        lambda s: s.update(w1=[1.0]),
        lambda s: s.update(b1=float('nan')),
        lambda s: s.update(ah5=0.0),
        lambda s: s.update(b1=1e9),
        lambda s: s.update(w2='x'),
    ],
)
def test_wrong_learned_state_leaves_the_estimator_untouched(learned, damage):
    estimator, bad = Estimator(SETTINGS), json.loads(json.dumps(learned))
    damage(bad)
    before = estimator.state.tobytes()
    with pytest.raises(ValueError, match='learned state'):
        estimator.restore(bad)
    assert estimator.state.tobytes() == before


def test_nothing_learned_cannot_be_saved():
    with pytest.raises(ValueError, match='waiting for the first good sample'):
        Estimator(SETTINGS).learned()


def test_nothing_is_ever_unpickled():  # FS-6
    unsafe = re.compile(
        r'\bpickle\b|yaml\.load\((?!text, Loader=_(?:LOADER|Loader)\))|\beval\('
        r'|allow_pickle=True|\bmarshal\b'
    )
    sources = list(Path(damadics_fd.__file__).parent.rglob('*.py'))
    assert len(sources) > 20
    assert rosbag2._LOADER in (yaml.BaseLoader, yaml.CBaseLoader)
    assert issubclass(yaml_text._Loader, (yaml.SafeLoader, yaml.CSafeLoader))
    assert [p.name for p in sources if unsafe.search(p.read_text('utf-8'))] == []
