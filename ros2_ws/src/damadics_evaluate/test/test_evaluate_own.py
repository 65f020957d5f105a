# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Detectors, scenarios and faults written outside the package; what no detector may do."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from damadics_evaluate import main
from damadics_evaluate.baselines import DETECTORS
from damadics_evaluate.benchmark import paper
from damadics_evaluate.columns import SCALE, columns_of, rows_of
from damadics_evaluate.detectors.check import problems
from damadics_evaluate.detectors.find import find_detector
from damadics_evaluate.detectors.own import RefusedError, adapted
from damadics_evaluate.scenarios.cases import case
from damadics_evaluate.scenarios.trajectories import CACHE_VARIABLE, scenario_run

EXAMPLE = Path(__file__).resolve().parents[1] / 'examples' / 'own_detector'
BAD = """\
import numpy as np
class Base:
    def fit(self, columns): self.n = len(columns['x1'])
    def statistic(self, columns): return np.abs(columns['cv'] - columns['x1'])
class Raises(Base):
    def statistic(self, columns): raise KeyError('x9')
class Nan(Base):
    def statistic(self, columns): return np.where(np.arange(len(columns['x1'])) > 9, np.nan, 0.0)
class Short(Base):
    def statistic(self, columns): return np.zeros(3)
class Text(Base):
    def statistic(self, columns): return 'high'
class Cut(Base):
    def statistic(self, columns):
        return super().statistic(columns) - super().statistic(columns).mean() + 1.0
class Peak(Base):
    def statistic(self, columns):
        s = super().statistic(columns)
        return s / s.max()
class Random(Base):
    def statistic(self, columns): return np.random.default_rng().random(len(columns['x1']))
class Writes(Base):
    def statistic(self, columns):
        columns['x1'] -= 1.0
        return np.zeros(len(columns['x1']))
class Pair(Base):
    statistic = None
    def update(self, sample): return 1.0
class Unfit(Base):
    def fit(self, columns): raise ZeroDivisionError('no data')
class Nothing:
    def fit(self, columns): pass
"""
REASONS = {
    'Raises': r"raises when it judges \(statistic\): KeyError: 'x9' \(bad.py, line 6\)",
    'Nan': 'returns NaN, first at sample 10',
    'Short': r'returns shape \(3,\)',
    'Text': 'returns str, no numbers|could not convert',
    'Cut': 'looks ahead',
    'Peak': 'looks ahead',
    'Random': 'not the same|judges a record otherwise',
    'Pair': r'update\(\) returned 1.0, not \(score, limit\)',
    'Unfit': r'raises when it learns \(fit\): ZeroDivisionError: no data',
}


@pytest.fixture(scope='module', autouse=True)
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(CACHE_VARIABLE, str(tmp_path_factory.mktemp('cache')))
        yield


@pytest.fixture(scope='module')
def bad(tmp_path_factory):
    file = tmp_path_factory.mktemp('bad') / 'bad.py'
    file.write_text(BAD)
    return file


@pytest.fixture(scope='module')
def records():
    """A made-up valve: it follows with a lag of one sample, then sticks."""
    rng = np.random.default_rng(4)

    def record(n, stuck=None):
        t = np.arange(n, dtype=float)
        cv = 0.5 + 0.2 * np.sin(t / 20.0) + rng.normal(0.0, 0.01, n)
        x = np.concatenate(([0.5], cv[:-1])) + rng.normal(0.0, 0.002, n)
        if stuck:
            x[stuck:] = x[stuck]
        flow = 0.7 - 0.4 * x + rng.normal(0.0, 0.002, n)
        levels = (rng.normal(level, 0.002, n) for level in (0.8, 0.6, 0.2))
        return np.column_stack((t, cv, x, *levels, flow))

    return record(900), record(900, stuck=600)


def test_rows_and_columns_are_two_forms_of_one_record(records):
    rows = records[0]
    columns = columns_of(rows)
    assert columns['stamp'].dtype == np.int64
    assert columns['p1'][5] == pytest.approx(rows[5, 3] * SCALE['p1'])
    assert np.allclose(rows_of(columns), rows)
    del columns['flow']
    assert np.isnan(rows_of(columns)[:, 6]).all()


FAST = [name for name in DETECTORS if name not in ('scada', 'fixed_r1', 'fixed_r2')]


@pytest.mark.parametrize('name', [n for n in FAST if n not in ('forest', 'mlp')])
def test_every_baseline_passes_the_test_for_any_detector(name, records):
    found = problems(find_detector(name), *records)
    assert not found, found


@pytest.mark.parametrize('name', ['my.py:Sluggish', 'online.py:OneSidedCusum'])
def test_the_examples_pass_it_and_find_a_stuck_stem(name, records):
    kind = adapted(f'{EXAMPLE}/{name}')
    assert problems(kind, *records) == []
    detector = kind()
    detector.t_on = detector.learn_from = 0.0
    detector.fit(records[0])
    statistic = detector.statistic(records[1])
    assert statistic[650:].max() > 2.0 * statistic[50:600].max()


@pytest.mark.parametrize(('name', 'reason'), REASONS.items())
def test_what_no_detector_may_do_is_told_with_its_name(bad, records, name, reason):
    found = '; '.join(problems(adapted(f'{bad}:{name}'), *records))
    assert found.startswith(f'{bad}:{name}')
    assert __import__('re').search(reason, found), found


def test_a_detector_cannot_change_what_the_others_see(bad, records):
    before = records[1].copy()
    detector = adapted(f'{bad}:Writes')()
    detector.fit(records[0])
    detector.statistic(records[1])
    assert np.array_equal(records[1], before)


def test_what_is_no_detector_is_refused_in_one_line(bad, tmp_path):
    for name, said in (
        (f'{bad}:Nothing', 'needs fit(columns) and either statistic(columns) or update(sample)'),
        (f'{bad}:Gone', 'has no Gone; it has Base'),
        (f'{tmp_path}/none.py:A', 'there is no file'),
        ('no.such.module:A', 'cannot be imported'),
        ('magic', 'and my.py:Class'),
    ):
        with pytest.raises(ValueError) as error:
            find_detector(name)
        assert said in str(error.value)
        assert '\n' not in str(error.value)
    broken = tmp_path / 'broken.py'
    broken.write_text('def f(:\n')
    with pytest.raises(ValueError, match='SyntaxError'):
        find_detector(f'{broken}:A')


def test_limits_of_their_own_are_kept(records):
    kind = adapted(f'{EXAMPLE}/online.py:OneSidedCusum')
    assert not kind.calibrated
    assert adapted(f'{EXAMPLE}/my.py:Sluggish').calibrated
    with pytest.raises(RefusedError):
        adapted_bad = adapted(f'{EXAMPLE}/online.py:OneSidedCusum')()
        adapted_bad._checked(np.array([np.nan]), 1)


def test_a_fault_of_ones_own_acts_on_valve_and_signals():
    found = case(f'{EXAMPLE}/my.py:SlackSpring')
    assert (found.zones.t_from, found.zones.t_hor, found.fault) == (900.0, 1500.0, 0)
    samples, strength = scenario_run(f'{EXAMPLE}/my.py:SlackSpring', 1)
    plain, _ = scenario_run('f11@0.01', 1)
    assert strength[899] == 0.0
    assert strength[900] == 0.5
    before, after = slice(100, 900), slice(960, 1500)
    assert np.abs(samples[before, 2] - plain[before, 2]).mean() < 0.003
    assert np.abs(samples[after, 2] - plain[after, 2]).mean() > 0.02


def test_a_scenario_of_ones_own_has_its_zones(tmp_path):
    found = case(f'{EXAMPLE}/my.yaml:mine')
    assert (found.zones.t_from, found.zones.t_hor, found.fault) == (900.0, 1800.0, 11)
    assert found.feed == f'{EXAMPLE}/my.yaml:mine'
    quiet = tmp_path / 'quiet.yaml'
    quiet.write_text('a: {duration: 100}\n')
    with pytest.raises(ValueError, match='has no fault'):
        case(f'{quiet}:a')


@pytest.fixture
def outside(tmp_path, monkeypatch):
    """Detectors, a scenario and a fault outside the repository; one of them installed."""
    folder = tmp_path / 'mine'
    shutil.copytree(EXAMPLE, folder)
    (folder / 'sluggish-1.0.dist-info').mkdir()
    meta = {
        'METADATA': 'Metadata-Version: 2.1\nName: sluggish\nVersion: 1.0\n',
        'entry_points.txt': '[damadics_evaluate.detectors]\nsluggish = my:Sluggish\n',
    }
    for name, text in meta.items():
        (folder / 'sluggish-1.0.dist-info' / name).write_text(text)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.chdir(folder)
    return folder


def refusals(err, *names):
    """Assert that those detectors were refused by name, each in one line."""
    for name in names:
        assert any('refused' in line.lower() and name in line for line in err.splitlines()), (
            name,
            err,
        )


def test_run_paper_lublin_and_report_take_what_is_ones_own(
    outside, tmp_path, bad, capsys, monkeypatch
):
    monkeypatch.setattr(paper, '_states', lambda *_: [])  # takes seconds, and is not ours to test
    out = tmp_path / 'results'
    options = ['--out', str(out), '--jobs', '1', '--calibration-days', '1', '--no-report']
    good = ['sluggish', 'online.py:OneSidedCusum']
    detectors = ['--detectors', *good, f'{bad}:Peak', f'{bad}:Raises']
    own = ['--scenarios', 'my.yaml:mine', '--faults', 'my.py:SlackSpring']
    assert main(['run', *options, *detectors, *own]) == 0
    said = capsys.readouterr().err
    refusals(said, 'Peak looks ahead', 'Raises raises')
    lines = [json.loads(line) for line in (out / 'results.jsonl').read_text().splitlines()]
    scenarios = [r for r in lines if r['kind'] == 'scenario']
    assert {r['detector'] for r in scenarios} == set(good)
    assert {r['scenario'] for r in scenarios} == {'my.yaml:mine', 'my.py:SlackSpring'}
    assert all(len(r['data_hash']) == 12 for r in scenarios)
    for slack in (r for r in scenarios if r['scenario'] == 'my.py:SlackSpring'):
        assert 0.0 <= slack['indices']['t_dt'] < 600.0

    assert main(['paper', str(out), *detectors]) == 0
    refusals(capsys.readouterr().err, 'Peak looks ahead', 'Raises raises')
    table = {row[0]: row[1:] for row in json.loads((out / 'paper.json').read_text())['rows']}
    assert table['Sluggish'][2:] == ['0 / 0', '0']
    assert len(table['OneSidedCusum']) == 4
    assert next(v for k, v in table.items() if 'Peak' in k) == ['refused'] * 4

    np.savetxt(tmp_path / '17112001.txt', sticking_day(), delimiter='\t', fmt='%.3f')
    file = str(tmp_path / '17112001.txt')
    assert main(['lublin', file, *detectors, '--campaign', str(out)]) == 0
    refusals(capsys.readouterr().out, 'Peak', 'Raises')
    grid = json.loads((out / 'lublin.json').read_text())['grid']
    row = next(row for row in grid if row[0].startswith('17 '))
    assert grid[0][1:3] == good
    assert [cell.startswith('+') for cell in row[1:3]] == [True, True]
    assert row[3:] == ['refused', 'refused']

    assert main(['report', str(out)]) == 0
    page = (out / 'index.html').read_text()
    assert all(word in page for word in ('SlackSpring', 'OneSidedCusum', 'Sluggish', 'A3 f16'))
    assert 'OneSidedCusum' in (out / 'detection.tex').read_text()
    for form in (page, (out / 'README.md').read_text()):
        refusals(form, 'Peak looks ahead', 'Raises raises')
        assert '2 of your own' in form


def sticking_day():
    """Part of a day in the plant's 33 columns: the stem of actuator 3 sticks during event 17."""
    rng = np.random.default_rng(3)
    t = np.arange(55000.0, 57700.0)
    table = np.full((len(t), 33), np.nan)
    cv = 50.0 + 10.0 * np.sin(t / 40.0)
    levels = np.array([600.0, 300.0, 90.0, 20.0])
    table[:, 0] = t
    table[:, 23:27] = levels + rng.normal(0.0, 1.0, (len(t), 4))
    table[:, 27], table[:, 28] = cv, cv + rng.normal(0.0, 0.2, len(t))
    table[(t >= 57475) & (t <= 57530), 28] -= 9.0
    return table


def test_check_says_what_is_wrong(bad, capsys):
    assert main(['check', str(EXAMPLE / 'my.py') + ':Sluggish']) == 0
    assert '1 detectors pass' in capsys.readouterr().out
    assert main(['check', f'{bad}:Nan']) == 1
    assert 'returns NaN' in capsys.readouterr().out
