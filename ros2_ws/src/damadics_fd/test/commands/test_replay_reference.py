# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Replay that begins with what was learned under nominal conditions, as the paper says."""

import json
from pathlib import Path

import pytest
from damadics_fd.commands.replay import replay
from damadics_fd.core.estimating import estimator_for
from damadics_fd.core.monitor import run
from damadics_fd.core.settings import Settings
from damadics_fd.store.references import Reference, save_reference
from damadics_plant import simulate

BAGS = Path(__file__).parents[5] / 'bags'
PASSES = 2
PAPER = Settings.for_mode('paper')


@pytest.fixture(scope='module')
def learned():
    nominal = simulate('paper_nominal', rate=400.0).columns
    kept = None
    for _ in range(PASSES):
        estimator = estimator_for(PAPER)
        if kept:
            estimator.restore(kept)
        run(nominal, PAPER, estimator)
        kept = estimator.learned()
    return kept


@pytest.fixture(scope='module')
def reference(learned, tmp_path_factory):
    path = tmp_path_factory.mktemp('reference') / 'LC74_20'
    save_reference(path, Reference('LC74_20', learned, PAPER.to_dict(), source='nominal'))
    return path


def detections(arguments, tmp_path, capsys):
    out = tmp_path / 'result.json'
    code = replay.main([*arguments, '--mode', 'paper', '--out', str(out)])
    text = capsys.readouterr()
    assert code == 0, text.err
    content = json.loads(out.read_text())
    rows = content['recordings'] if isinstance(content, dict) else content
    return [round(d['t'], 4) for d in rows[0]['detections']]


@pytest.mark.parametrize(
    ('name', 'instants'), [('nominal', []), ('friction', [81.1225]), ('spring', [70.005])]
)
def test_a_learned_start_decides_after_the_fault_only(name, instants, reference, tmp_path, capsys):
    bag = str(BAGS / f'dablib_{name}.mcap')
    assert detections([bag, '--reference', str(reference)], tmp_path, capsys) == instants
    assert len(detections([bag], tmp_path, capsys)) >= 5, 'the zero start decides before'


def test_a_reference_of_another_mode_is_refused(reference, capsys):
    bag = str(BAGS / 'dablib_nominal.mcap')
    assert replay.main([bag, '--mode', 'monitor', '--reference', str(reference)]) == 1
    assert 'learned with other settings' in capsys.readouterr().err


def test_a_reference_that_is_not_there_is_refused(tmp_path, capsys):
    bag = str(BAGS / 'dablib_nominal.mcap')
    assert replay.main([bag, '--mode', 'paper', '--reference', str(tmp_path / 'none')]) == 1
    assert 'none is kept yet' in capsys.readouterr().err


def test_paper_mode_has_nothing_to_save_before_the_first_sample():
    with pytest.raises(ValueError, match='nothing to save'):
        estimator_for(PAPER).learned()
