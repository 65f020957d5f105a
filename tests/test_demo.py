# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The demo: the paper's experiments, live, recorded and from the bags."""

import json
import subprocess
from pathlib import Path

import pytest
from damadics_bringup.processes import executable

SAMPLES = 48001


@pytest.fixture(scope='module')
def demo(tmp_path_factory):
    out = tmp_path_factory.mktemp('demo')
    done = subprocess.run(
        [executable('damadics_bringup', 'demo'), '--out', str(out)],
        capture_output=True,
        text=True,
        timeout=560,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads((out / 'results.json').read_text()), done.stdout


@pytest.mark.ros
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ('name', 'first', 'second'), [('friction', 81.12, 81.1225), ('spring', 70.0025, 70.005)]
)
def test_the_demo_reproduces_the_paper(demo, name, first, second):
    results, printed = demo
    result = results[name]
    assert result['exceeds_at'] == pytest.approx(first, abs=1e-9)
    assert result['detected_at'] == pytest.approx(second, abs=1e-9)
    assert result['before_fault'] == []
    assert result['offline_detected_at'] == result['detected_at']
    assert result['agrees_with_paper']
    assert f'{second:.4f}' in printed


@pytest.mark.ros
@pytest.mark.timeout(600)
@pytest.mark.parametrize('name', ['nominal', 'friction', 'spring'])
def test_nothing_is_lost_and_live_is_off_line(demo, name):
    result = demo[0][name]
    assert result['identical']
    assert set(result['counts'].values()) == {SAMPLES}
    assert result['lost'] == 0
    assert Path(result['figure']).stat().st_size > 50_000
    assert (Path(result['bag']) / 'metadata.yaml').is_file()


@pytest.mark.ros
@pytest.mark.timeout(600)
def test_the_fault_free_run_decides_nothing_once_it_is_learned(demo):
    assert demo[0]['nominal']['decisions'] == []


@pytest.mark.ros
@pytest.mark.timeout(600)
def test_zero_weights_decide_before_the_fault(demo):
    zero = demo[0]['zero_start']
    before = [0.005, 2.8975, 11.5975, 30.795, 50.8075]
    assert zero['friction']['before_fault'] == pytest.approx(before, abs=1e-9)
    assert zero['spring']['before_fault'] == pytest.approx(before, abs=1e-9)
    assert zero['friction']['detected_at'] == pytest.approx(81.12, abs=1e-9)
    assert zero['spring']['detected_at'] == pytest.approx(70.005, abs=1e-9)
    assert zero['nominal']['decisions'] == pytest.approx([*before, 80.45], abs=1e-9)
