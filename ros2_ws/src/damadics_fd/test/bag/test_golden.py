# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The golden recordings give exactly the flags noted with them."""

import json
from pathlib import Path

import pytest
from damadics_fd.bag.checking.inspection import WHOLE, inspect
from damadics_fd.commands.replay.replay import main

BAGS = Path(__file__).parents[5] / 'bags'
EXPECTED = json.loads((BAGS / 'golden.json').read_text()) if BAGS.is_dir() else {}

pytestmark = pytest.mark.skipif(not EXPECTED, reason='bags/ is not here: an installed package')


@pytest.mark.parametrize('name', EXPECTED)
def test_golden_bags_are_whole_and_give_their_flags(name, tmp_path):
    expected = EXPECTED[name]
    assert inspect(BAGS / f'{name}.mcap').code == WHOLE
    out = tmp_path / 'result.json'
    path = str(BAGS / f'{name}.mcap')
    assert main([path, '--mode', expected['mode'], '--out', str(out)]) == 0
    (result,) = json.loads(out.read_text())
    assert result['samples'] == expected['samples']
    found = [detection['stamp'] for detection in result['detections']]
    assert found == expected['detections_ns'], 'if meant so: python bags/make_golden.py'


def test_the_experiments_of_the_paper_are_detected_at_its_instants():
    def first_after(name: str, onset: float) -> float:
        return next(t / 1e9 for t in EXPECTED[name]['detections_ns'] if t / 1e9 >= onset)

    assert first_after('dablib_friction', 70.0) == 81.12
    assert first_after('dablib_spring', 70.0) == 70.005
    assert EXPECTED['lugre_nominal']['detections_ns'] == []
    assert 70.0 < first_after('lugre_friction', 70.0) < 75.0
    assert 70.0 < first_after('lugre_spring', 70.0) < 70.1
