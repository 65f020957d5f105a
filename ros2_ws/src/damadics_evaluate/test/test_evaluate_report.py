# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The report of a whole campaign: its size; isolation over time; a campaign that was killed."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from damadics_evaluate.baselines import DETECTORS
from damadics_evaluate.baselines.drift import _page_hinkley
from damadics_evaluate.benchmark.campaign import CALIBRATION_SEED, Campaign
from damadics_evaluate.benchmark.isolation import END, LABELS, isolation_result, verdict
from damadics_evaluate.benchmark.runner import read_results
from damadics_evaluate.benchmark.units import FACTORS
from damadics_evaluate.detectors.base import Detector, Diagnosis
from damadics_evaluate.report.tables import confusion, isolation_over_time, named_over_time
from damadics_evaluate.report.write import write_report
from damadics_evaluate.scenarios.cases import SCENARIOS, case

SEEDS = 20


def judged(rng, scenario, detector, seed):
    found = rng.random() < 0.8
    t_dt = float(np.round(10 ** rng.uniform(0, 4))) if found else None
    fault = case(scenario).fault
    result = {
        'kind': 'scenario',
        'scenario': scenario,
        'fault': fault,
        'seed': seed,
        'detector': detector,
        'limit': 1.0,
        'settings_hash': detector,
        'data_hash': '0' * 12,
        'indices': {'t_dt': t_dt, 'r_fd': 0.0, 'r_td': 0.9, 'f_sd': 0.25 if found else None},
        'crossings': [900.0 + (t_dt or 0.0) * f if found else None for f in FACTORS],
    }
    if detector in ('scada', 'forest', 'mlp') and found:
        named = int(rng.integers(1, 20))
        at = {'named': named, 'verdict': verdict(named, fault)}
        result['isolation'] = {
            'over_time': dict.fromkeys((*LABELS.values(), END), at),
            'right_first': named == fault,
            'right_group': True,
            'indices': {'t_it': 60.0},
        }
    if detector == 'scada':
        names = ('m1', 'g1', 'd1', 'rms1', 'm2', 'g2', 'rms2', 'dP1', 'dP2', 'dT1')
        result |= {'test': 'r1', 'signature': {n: float(rng.normal()) for n in names}}
    return result


def test_the_page_of_a_whole_campaign_is_below_300_kb(tmp_path):
    rng = np.random.default_rng(5)
    lines = [
        judged(rng, scenario, detector, seed)
        for scenario in SCENARIOS
        for detector in DETECTORS
        for seed in range(SEEDS if detector in ('scada', 'fir_cusum') else 2)
    ]
    lines += [
        {
            'kind': 'nominal',
            'detector': detector,
            'seed': CALIBRATION_SEED + day,
            'settings_hash': detector,
            'hourly_max': rng.uniform(0.2, 0.9, 24).tolist(),
        }
        for detector in DETECTORS
        for day in range(3)
    ]
    (tmp_path / 'results.jsonl').write_text('\n'.join(map(json.dumps, lines)))
    stated = {'scenarios': SCENARIOS, 'detectors': list(DETECTORS), 'seeds': list(range(SEEDS))}
    versions = {'damadics_fd': '0', 'python': '3', 'numpy': '2', 'numba': '0'}
    manifest = {'campaign': {**stated, 'calibration_days': 3}, 'versions': versions}
    (tmp_path / 'campaign.json').write_text(json.dumps(manifest))
    picture = '<img src="data:image/png;base64,' + 'A' * 30_000 + '">'
    paper = {'text': '', 'columns': ['a'], 'rows': [['x', '1']] * 18, 'figures': picture * 2}
    (tmp_path / 'paper.json').write_text(json.dumps(paper))
    grid = [
        ['event', *DETECTORS],
        *([f'event {i}', *('+5 f16' for _ in DETECTORS)] for i in range(25)),
    ]
    (tmp_path / 'lublin.json').write_text(
        json.dumps({'rules': 'rules', 'grid': grid, 'notes': ['a note of some length'] * 60})
    )
    files = {file.name: file for file in write_report(tmp_path, tmp_path / 'report')}
    page = files['index.html'].read_text()
    assert len(page.encode()) < 300_000
    assert page.count('<svg') == 5
    assert 'The faults induced in the real plant' in page
    assert '<script>alert' not in page
    assert len(files['summary.csv'].read_text().splitlines()) == 1 + 44 * len(DETECTORS)
    assert files['detection.tex'].read_text().count(r'\\') >= 45


class Namer(Detector):
    """Names f18 for an hour, then f6."""

    name, title = 'namer', 'namer'

    def fit(self, hour):
        """Learn nothing."""

    def statistic(self, samples):
        """Return nothing."""
        return np.zeros(len(samples))

    def isolate_at(self, samples, alarm, times):
        """Name by time."""
        named = ((t, 18 if t < alarm + 3600 else 6) for t in times)
        return [Diagnosis(t, ((f, 0.5, 0.0), (1, 0.1, 3.0)), (f,)) for t, f in named]


def test_isolation_is_judged_at_times_after_the_alarm():
    t = np.arange(0.0, 87901.0)
    rows = np.zeros((len(t), 7))
    rows[:, 0] = t
    strength = np.clip((t - 900.0) / 86400.0, 0.0, 1.0)
    found = isolation_result(Namer(), case('f6_I'), 1000.0, rows, strength)
    named = {after: d['named'] for after, d in found['over_time'].items()}
    assert named == {'1 min': 18, '10 min': 18, '1 h': 6, '6 h': 6, '24 h': 6, 'end': 6}
    judged_at = {after: d['verdict'] for after, d in found['over_time'].items()}
    assert judged_at['10 min'] == 'same law'
    assert judged_at['6 h'] == 'right'
    assert found['indices']['t_it'] == 1000.0 + 3600.0 - 900.0
    assert not found['right_first']
    assert isolation_result(Namer(), case('f6_I'), None, rows, strength) is None
    result = {
        'kind': 'scenario',
        'scenario': 'f6_I',
        'fault': 6,
        'detector': 'namer',
        'isolation': found,
    }
    shares = {r['after']: (r['right'], r['same_law']) for r in isolation_over_time([result])}
    assert shares['1 min'] == (0.0, 1.0)
    assert shares['24 h'] == (1.0, 0.0)
    assert named_over_time([result], 'namer')[0]['cells'][0] == 'f18 1/1'
    assert confusion([result], 'namer') == []


def test_page_hinkley_is_that_of_river():
    river = pytest.importorskip('river.drift')
    rng = np.random.default_rng(8)
    for case_number in range(20):
        values = np.abs(rng.normal(0.0, 1.0, 600))
        values[300:] += rng.uniform(0.0, 1.5)
        threshold, delta = float(rng.uniform(5.0, 30.0)), float(rng.uniform(0.01, 0.2))
        statistic = _page_hinkley(values, delta, 0.9999)
        test = river.PageHinkley(30, delta, threshold, 0.9999)
        first = None
        for i, value in enumerate(values.tolist()):
            test.update(value)
            if test.drift_detected:
                first = i
                break
        ours = np.flatnonzero(statistic[29:] > threshold)
        assert first == (int(ours[0]) + 29 if len(ours) else None), case_number


def test_a_campaign_that_is_killed_goes_on(tmp_path):
    out, cache = tmp_path / 'results', tmp_path / 'cache'
    environment = {
        **os.environ,
        'PYTHONPATH': os.pathsep.join(p for p in sys.path if p),
        'DAMADICS_FD_CACHE': str(cache),
    }
    code = 'import sys; from damadics_evaluate import main; sys.exit(main(sys.argv[1:]))'
    scenarios = ['f18_S', 'f19_B', 'f17_B', 'f13_B']
    command = [sys.executable, '-c', code, 'run', '--out', str(out), '--jobs', '1']
    command += ['--detectors', 'scada', '--isolated-seeds', '0', '--no-report', '--scenarios']
    command += scenarios
    process = subprocess.Popen(
        command, env=environment, start_new_session=True, stderr=subprocess.DEVNULL
    )
    file = out / 'results.jsonl'
    deadline = time.monotonic() + 200.0
    while time.monotonic() < deadline and process.poll() is None:
        if file.exists() and file.read_text().count('\n') >= 1:
            break
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = {r['scenario']: r for r in read_results(out)}
    assert before
    with file.open('a') as stream:
        stream.write('{"kind": "scenario", "scen')  # torn by the kill
    subprocess.run(command, env=environment, check=True, timeout=250, capture_output=True)
    after = read_results(out)
    assert sorted(r['scenario'] for r in after) == sorted(scenarios)  # each once
    for r in after:
        if r['scenario'] in before:
            assert r == before[r['scenario']]
        assert r['settings_hash'] == Campaign().settings_hash('scada')
