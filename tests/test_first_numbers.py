# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a sceptical user asks for next: the real plant's record, and what else there is."""

import json
import re
import subprocess
from pathlib import Path

import pytest
import website
from damadics_bringup.processes import executable

LUBLIN = Path(__file__).resolve().parents[2] / 'shared/data/lublin_actuator3_20min_1hz.csv'
LEARNED = 900.0  # s, the end of learning in mode scada


@pytest.fixture
def chromium():
    with website.browser() as chromium:
        yield chromium


def stuck(since: float, folder: Path) -> Path:
    """Write the plant's record with the stem standing still from some instant on [s]."""
    head, *lines = LUBLIN.read_text().splitlines()
    position = head.split(',').index('L74_20X_X_pct')
    rows = [line.split(',') for line in lines]
    held = next(row[position] for row in rows if float(row[0]) >= since)
    for row in rows:
        if float(row[0]) >= since:
            row[position] = held
    path = folder / f'stuck_{since:.0f}.csv'
    path.write_text('\n'.join([head, *(','.join(row) for row in rows), '']))
    return path


@pytest.mark.skipif(
    not LUBLIN.is_file(), reason=f'{LUBLIN} is not there: it carries no redistribution licence'
)
def test_the_real_plant_gives_no_alarm_and_a_stuck_stem_one(tmp_path):
    instants = [LEARNED + 50.0 * n for n in range(1, 6)]
    files = [stuck(since, tmp_path) for since in instants]
    out = tmp_path / 'replay.json'
    words = [*map(str, (LUBLIN, *files)), '--mode', 'scada', '--jobs', '1', '--out', str(out)]
    done = subprocess.run(
        [executable('damadics_fd', 'replay'), *words], capture_output=True, text=True, timeout=250
    )
    assert done.returncode == 0, done.stderr
    healthy, *faulty = json.loads(out.read_text())
    assert healthy['samples'] == 1200
    assert healthy['detections'] == []
    delays = [r['detections'][0]['t'] - t for r, t in zip(faulty, instants, strict=True)]
    print('delays after the stem is stuck, s:', delays)
    assert all(0.0 <= delay <= 20.0 for delay in delays)


def test_the_report_compares_with_what_else_there_is(tmp_path, chromium, monkeypatch):
    pytest.importorskip('filterpy')
    pytest.importorskip('river')
    evaluate = executable('damadics_evaluate', 'evaluate')
    campaign = [
        'run',
        '--out',
        str(tmp_path),
        '--scenarios',
        'f16_B',
        '--detectors',
        'scada',
        'cusum',
        'ekf',
        'adwin',
        '--calibration-days',
        '1',
        '--isolated-seeds',
        '0',
    ]
    monkeypatch.setenv('DAMADICS_FD_CACHE', str(tmp_path / 'cache'))
    done = subprocess.run([evaluate, *campaign], capture_output=True, text=True, timeout=250)
    assert done.returncode == 0, done.stderr
    report = tmp_path / 'index.html'
    if chromium:
        page = website.new_page(chromium)
        errors: list[str] = []
        page.on('pageerror', lambda error: errors.append(str(error)))
        page.goto(report.as_uri())
        heads = page.locator('table').first.locator('th').all_inner_texts()
        page.close()
        assert not errors
    else:
        table = report.read_text().partition('<table')[2].partition('</thead>')[0]
        heads = re.findall(r'<th[^>]*>([^<]*)', table)
    for name in ('SCADA-rate monitor', 'CUSUM', 'EKF', 'ADWIN'):
        assert any(head.strip().startswith(name) for head in heads), f'{name} is not in {heads}'
