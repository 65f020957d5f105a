# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The demo: the paper's experiments, live, recorded and from the bags."""

import json
import subprocess
from pathlib import Path

import pytest
from damadics_bringup.processes import executable


@pytest.fixture(scope='module')
def demo(tmp_path_factory):
    out = tmp_path_factory.mktemp('demo')
    done = subprocess.run(
        [executable('damadics_bringup', 'demo'), '--out', str(out)],
        capture_output=True,
        text=True,
        timeout=280,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads((out / 'results.json').read_text()), done.stdout


@pytest.mark.ros
@pytest.mark.timeout(300)
@pytest.mark.parametrize(('name', 'instant'), [('friction', 81.12), ('spring', 70.005)])
def test_the_demo_reproduces_the_paper(demo, name, instant):
    results, printed = demo
    result = results[name]
    assert result['detected_at'] == pytest.approx(instant, abs=1e-9)
    assert result['offline_detected_at'] == result['detected_at']
    assert result['identical']
    assert result['before'], 'the printed method decides before the fault too: list it'
    assert set(result['counts'].values()) == {48001}
    assert result['lost'] == 0
    assert Path(result['figure']).stat().st_size > 50_000
    assert (Path(result['bag']) / 'metadata.yaml').is_file()
    assert name in printed
