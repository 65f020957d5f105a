# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Campaigns: units of work, resume, tables, comparison, report, Dask."""

import json
import math
import re

import numpy as np
import pytest
from damadics_evaluate import main
from damadics_evaluate.benchmark.campaign import (
    CALIBRATION_SEED,
    NOMINAL_SEED,
    Campaign,
)
from damadics_evaluate.benchmark.compare import compare, holm, overall, sign_test
from damadics_evaluate.benchmark.runner import read_results, run_campaign
from damadics_evaluate.benchmark.tables import (
    false_alarms,
    operating_curve,
    quantile,
    summary,
)
from damadics_evaluate.benchmark.units import debounced, limits, scenario_unit
from damadics_evaluate.scenarios.cases import SCENARIOS, case
from damadics_evaluate.scenarios.trajectories import (
    CACHE_VARIABLE,
    learning_hour,
    scenario_run,
)


@pytest.fixture(scope='module', autouse=True)
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(CACHE_VARIABLE, str(tmp_path_factory.mktemp('cache')))
        yield


@pytest.fixture(scope='module')
def spring_results():
    campaign = Campaign(('f11_B',), ('scada', 'fixed', 'fixed_r1'), seeds=(3,))
    return scenario_unit(campaign, {'scada': 1.0, 'fixed': 5.0, 'fixed_r1': 0.015}, 'f11_B', 3)


def test_the_44_scenarios():
    assert len(SCENARIOS) == len(set(SCENARIOS)) == 44
    assert case('f13_I').zones.t_hor == 2400.0
    assert case('f2_I').duration == 87900
    with pytest.raises(ValueError, match='f20_S'):
        case('f20_S')


def test_runs_repeat_and_seeds_differ():
    samples, strength = scenario_run('f18_S', 2)
    again, _ = scenario_run('f18_S', 2)
    other, _ = scenario_run('f18_S', 3)
    assert np.array_equal(samples, again)
    assert not np.array_equal(samples[:, 2], other[:, 2])
    assert np.array_equal(samples[:, 1], other[:, 1])  # CV is known undisturbed
    assert strength[899] == 0.0
    assert strength[900] == 0.25
    assert learning_hour(2).shape == (3600, 7)


def test_a_unit_finds_and_names_the_fault(spring_results):
    ours, fixed, model = spring_results
    assert ours['indices']['t_dt'] <= 2.0  # one sample alone never raises an alarm
    assert ours['indices']['r_fd'] == 0.0
    assert ours['indices']['f_sd'] == 0.75
    assert ours['isolation']['right_first']
    assert ours['isolation']['right_group']
    assert ours['isolation']['indices']['t_it'] <= 62.0  # named a minute after the alarm
    assert ours['signature']['rms1'] > 0.01
    assert model['indices']['t_dt'] <= 1.0
    assert fixed['indices']['t_dt'] >= 0.0
    assert len(ours['settings_hash']) == 12
    json.dumps(spring_results)  # plain data


def test_limits_come_from_the_calibration_days_only():
    def day(seed, peak):
        return {'kind': 'nominal', 'detector': 'fixed', 'seed': seed, 'hourly_max': [1.0, peak]}

    campaign = Campaign(detectors=('fixed', 'scada'))
    days = [day(CALIBRATION_SEED, 4.0), day(CALIBRATION_SEED + 1, 5.0), day(NOMINAL_SEED, 9.0)]
    found = limits(campaign, days)
    assert found == {'fixed': pytest.approx(5.5), 'scada': 1.0}
    row = false_alarms(days, found, NOMINAL_SEED)[0]
    assert (row['days'], row['days_with_alarm']) == (1, 1)


def test_campaign_refuses_what_it_does_not_know():
    with pytest.raises(ValueError, match='no detector magic'):
        Campaign(detectors=('magic',))
    with pytest.raises(ValueError, match='no scenario f3_S'):
        Campaign(scenarios=('f3_S',))
    with pytest.raises(ValueError, match=r'no scenario f16_s: do you mean f16_S\?'):
        Campaign(scenarios=('f16_s',))
    with pytest.raises(ValueError, match='debounce'):
        Campaign(debounce=0)


def test_the_settings_hash_tells_settings_apart():
    assert Campaign().settings_hash('scada') != Campaign(debounce=2).settings_hash('scada')
    assert Campaign().settings_hash('scada') == Campaign(seeds=(1, 2)).settings_hash('scada')
    assert Campaign().settings_hash('scada') != Campaign().settings_hash('ewma')


def test_debounce_wants_consecutive_samples():
    assert debounced(np.array([9.0, 0.0, 9.0, 9.0, 9.0]), 3).tolist() == [0, 0, 0, 0, 9]


def result(scenario, detector, seed, t_dt):
    found = math.isfinite(t_dt)
    return {
        'kind': 'scenario',
        'scenario': scenario,
        'detector': detector,
        'seed': seed,
        'settings_hash': detector,
        'crossings': [900.0 + t_dt if found else None] * 33,
        'indices': {
            't_dt': t_dt if found else None,
            'r_fd': 0.0,
            'r_td': 0.5,
            'f_sd': 0.25 if found else None,
        },
    }


def test_results_of_other_settings_give_way_to_newer_ones(tmp_path):
    old, new = result('f1_S', 'scada', 0, 9.0), result('f1_S', 'scada', 0, 3.0)
    other = result('f1_S', 'ewma', 0, 5.0)
    lines = [json.dumps(r) for r in (old, other, {**new, 'settings_hash': 'new'})]
    (tmp_path / 'results.jsonl').write_text('\n'.join([*lines, '{"torn']))
    times = {r['detector']: r['indices']['t_dt'] for r in read_results(tmp_path)}
    assert times == {'scada': 3.0, 'ewma': 5.0}
    assert len(read_results(tmp_path)) == 2


def test_summary_and_comparison():
    a = [result('f1_S', 'scada', s, t) for s, t in enumerate((10, 20, math.inf))]
    b = [result('f1_S', 'scada', s, t) for s, t in enumerate((5, 20, 30))]
    row = summary(a)[0]
    assert (row['runs'], row['detected'], row['t_dt_median']) == (3, 2, 20)
    assert row['t_dt_p90'] == math.inf
    versus = compare(a, b)[0]
    assert (versus['earlier_in_b'], versus['later_in_b']) == (2, 0)
    assert versus['p'] == pytest.approx(0.5)
    assert versus['p_holm'] == versus['p']  # one row only
    whole = overall(a, b)[0]
    assert (whole['pairs'], whole['earlier_in_b'], whole['only_in_b']) == (3, 2, 1)
    assert whole['difference'] == -5
    assert holm([0.01, 0.5, 0.02]) == [pytest.approx(0.03), 0.5, pytest.approx(0.04)]
    assert sign_test(10, 0) == pytest.approx(2 / 1024)
    assert quantile([3.0, 1.0, 2.0, math.inf], 0.5) == 2.0


def test_operating_curve_counts_hours_and_misses():
    nominal = {'kind': 'nominal', 'detector': 'x', 'seed': 0, 'hourly_max': [0.3] * 23 + [2.0]}
    runs = [result('f1_S', 'x', 0, 10.0), result('f1_M', 'x', 0, math.inf)]
    curve = operating_curve([nominal, *runs], 'x', 1.0, 0)
    assert curve['false_per_day'][0] == 24.0  # factor 0.25
    assert curve['false_per_day'][16] == 1.0  # factor 1
    assert curve['false_per_day'][-1] == 0.0
    assert curve['missed'] == [0.5] * 33


def test_dask_cluster_gives_what_local_processes_give(tmp_path):
    distributed = pytest.importorskip('distributed')
    campaign = Campaign(
        scenarios=('f18_S', 'f19_B'), detectors=('scada',), isolated_seeds=0, seeds=(0,)
    )
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, processes=True
    ) as cluster:
        there = run_campaign(campaign, tmp_path / 'dask', scheduler=cluster.scheduler_address)
    here = run_campaign(campaign, tmp_path / 'local', jobs=2)
    assert len(there) == 2

    def key(results):
        return sorted((r['scenario'], json.dumps(r['indices'])) for r in results)

    assert key(there) == key(here)
    assert run_campaign(campaign, tmp_path / 'local', jobs=1) == here  # nothing left to do
    lines = (tmp_path / 'local' / 'results.jsonl').read_text()
    (tmp_path / 'local' / 'results.jsonl').write_text(lines + '{"torn')
    assert len(read_results(tmp_path / 'local')) == 2
    assert all(r['versions']['numpy'] for r in here)


def test_an_unreachable_scheduler_is_an_error(capsys, tmp_path):
    pytest.importorskip('distributed')
    arguments = ['--scheduler', 'tcp://127.0.0.1:9', '--scenarios', 'f18_S', '--detectors']
    assert main(['run', '--out', str(tmp_path), *arguments, 'scada']) == 1
    assert 'tcp://127.0.0.1:9' in capsys.readouterr().err


def test_report_and_compare_commands(tmp_path, capsys, spring_results):
    pytest.importorskip('jinja2')
    pytest.importorskip('matplotlib')
    for name in ('a', 'b'):
        directory = tmp_path / name
        directory.mkdir()
        days = [
            {
                'kind': 'nominal',
                'detector': d,
                'seed': CALIBRATION_SEED,
                'settings_hash': Campaign().settings_hash(d),
                'hourly_max': [1.0] * 24,
            }
            for d in ('fixed', 'fixed_r1')
        ]
        lines = [json.dumps(r) for r in (*spring_results, *days)]
        (directory / 'results.jsonl').write_text('\n'.join(lines))
        stated = {
            'scenarios': ['f11_B'],
            'detectors': ['scada', 'fixed', 'fixed_r1'],
            'seeds': [3],
            'calibration_days': 1,
            'nominal_days': 0,
            'debounce': 1,
        }
        versions = {'damadics_fd': '0', 'python': '3', 'numpy': '2', 'numba': '0'}
        (directory / 'campaign.json').write_text(
            json.dumps({'campaign': stated, 'versions': versions})
        )
    assert main(['report', str(tmp_path / 'a')]) == 0
    page = (tmp_path / 'a' / 'index.html').read_text()
    assert page.count('<svg') == 5
    assert 'Isolation over time' in page
    assert 'addEventListener' in page  # tables are sorted by a click
    tex = (tmp_path / 'a' / 'detection.tex').read_text()
    assert tex.count(r'\\') == 2
    assert r'f11\_B' in tex
    isolation = (tmp_path / 'a' / 'isolation.csv').read_text()
    assert isolation.startswith('detector,after,runs,right,same_law,wrong')
    assert 'scada,1 min,1,1.0,0.0,0.0' in isolation
    assert 'S1-FF-f11' in page
    assert not re.search(r'(src|href)=["\']?https?:', page)  # nothing is loaded from elsewhere
    assert 'f11_B' in (tmp_path / 'a' / 'README.md').read_text()
    assert (tmp_path / 'a' / 'summary.csv').read_text().count('f11_B') == 3
    assert main(['compare', str(tmp_path / 'a'), str(tmp_path / 'b')]) == 0
    assert '3 of 3 pairs without a difference' in capsys.readouterr().out
    assert main(['compare', str(tmp_path / 'a'), str(tmp_path / 'none')]) == 1
    assert 'evaluate run' in capsys.readouterr().err
