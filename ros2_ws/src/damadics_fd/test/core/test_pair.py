# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Estimator and detector in one call a sample: the same bits as one after the other."""

import math
import os
import subprocess
import sys

import pytest
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.bank import pair
from damadics_fd.core.bank.pair import Pair
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.quality import Refused
from damadics_fd.core.sample import COLUMNS, Sample
from damadics_fd.core.settings import Settings

from .test_bank import moving, rubbing


def samples(columns):
    """Return the rows of a recording as samples."""
    table = [columns[name].tolist() if name in columns else None for name in COLUMNS]
    length = len(columns['stamp'])
    filled = [column or [math.nan] * length for column in table]
    return [Sample(*row) for row in zip(*filled, strict=True)]


def one_after_the_other(rows, settings, judging):
    """Return what the two have after each sample, and the two."""
    estimator, detector = Estimator(settings), Detector(judging)
    told = []
    for sample in rows:
        estimate = estimator.update(*sample)
        if isinstance(estimate, Refused):
            told.append(estimate)
        else:
            told.append(detector.update(estimate))
    return told, estimator, detector


def at_once(rows, settings, judging):
    """Return the same of a pair, and how often it left an estimate to the detector."""
    estimator, detector = Estimator(settings), Detector(judging)
    both = Pair(estimator, detector)
    told, left = [], 0
    phase, last, shown = -1, -1, None
    for sample in rows:
        before = detector.signature.state[['state', 'family', 'cause']][0].item()
        news = both.take(sample, phase, last)
        if news <= pair.REFUSED:
            told.append(
                estimator.note(pair.REFUSED - news, sample.stamp, sample[1:], estimator.last_stamp)
            )
            continue
        if news == pair.ESTIMATED:
            left += 1
            detector.update(estimator.latest)
        else:
            after = detector.signature.state[['state', 'family', 'cause']][0].item()
            assert bool(news & pair.SIGNED) == (before != after)
            assert bool(news & pair.HAPPENED) == bool(detector.decision.transitions)
            assert bool(news & pair.SHOWN) == (detector.decision.shown != shown)
        decision = detector.decision
        phase, last, shown = detector.estimate.phase, decision.stamp, decision.shown
        told.append(decision)
    return told, estimator, detector, left


@pytest.mark.parametrize(
    ('make', 'mode', 'changes', 'judging'),
    [
        (moving, 'paper', {}, {}),
        (moving, 'paper', {}, {'decide_m': 1}),
        (rubbing, 'monitor', {}, {}),
        (rubbing, 'monitor', {'mass': 1.9}, {'mass': 1.9, 'latch': False}),
    ],
)
def test_a_pair_gives_the_bits_of_its_two(make, mode, changes, judging):
    rows = samples(make(1))
    settings, others = Settings.for_mode(mode, **changes), Settings.for_mode(mode, **judging)
    expected, estimator, detector = one_after_the_other(rows, settings, others)
    told, first, second, left = at_once(rows, settings, others)
    assert [str(one) for one in told] == [str(one) for one in expected]
    assert any(one.transitions for one in told if not isinstance(one, Refused))
    for one, other in zip(
        (*first.arrays, *second.arrays), (*estimator.arrays, *detector.arrays), strict=True
    ):
        assert one.tobytes() == other.tobytes()
    assert first.counters == estimator.counters
    assert 0 < left < 20, 'nearly every estimate is judged with its sample'


def test_an_estimate_with_the_stamp_of_the_latest_decision_is_not_judged():
    settings = Settings.for_mode('paper')
    estimator, detector = Estimator(settings), Detector(settings)
    both = Pair(estimator, detector)
    phase = estimator.update(*Sample(1, 0.5, 0.5)).phase
    before = detector.state.tobytes()
    assert both.take(Sample(2_500_001, 0.5, 0.5), phase, 2_500_001) == pair.ESTIMATED
    assert detector.state.tobytes() == before
    assert estimator.latest.stamp == 2_500_001
    assert both.take(Sample(5_000_001, 0.5, 0.5), phase, 2_500_001) >= 0
    assert detector.decision.stamp == 5_000_001
    refused = both.take(Sample(7_500_001, math.nan, 0.5), phase, 5_000_001)
    assert estimator.counters['not_finite'] == 1
    assert refused < pair.REFUSED


def test_a_node_of_one_valve_loads_neither_mode_scada_nor_tools():
    """Each of them would make a node start a twentieth later, or more."""
    code = 'import sys, damadics_fd.core.bank.pair; print(*sys.modules)'
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}
    told = subprocess.run(
        [sys.executable, '-c', code], env=environment, capture_output=True, text=True, check=True
    )
    loaded = told.stdout.split()
    assert 'numba' in loaded
    assert not [name for name in loaded if '.scada' in name or name == 'coverage']


def test_a_node_that_judges_loads_nothing_that_no_kernel_calls(tmp_path):
    """numba takes in scipy and cffi with the first compiled call, wherever they are installed."""
    (tmp_path / 'judging.py').write_text(
        'import sys\n'
        'from damadics_fd.core.bank.pair import Pair\n'
        'from damadics_fd.core.decision.detector import Detector\n'
        'from damadics_fd.core.approximator.estimator import Estimator\n'
        'from damadics_fd.core.sample import Sample\n'
        'from damadics_fd.core.settings import Settings\n'
        'def main():\n'
        "    settings = Settings.for_mode('paper')\n"
        '    both = Pair(Estimator(settings), Detector(settings))\n'
        '    both.take(Sample(1, 0.5, 0.5), 0, 0)\n'
        '    print(*(name for name, module in sys.modules.items() if module))\n'
        '    return 0\n'
    )
    code = "import sys; from damadics_fd.start import run_node; sys.exit(run_node('judging'))"
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join([str(tmp_path), *sys.path])}
    told = subprocess.run(
        [sys.executable, '-c', code], env=environment, capture_output=True, text=True, check=True
    )
    loaded = {name.partition('.')[0] for name in told.stdout.split()}
    assert {'numba', 'damadics_fd'} <= loaded
    assert not loaded & {'scipy', 'cffi', 'coverage'}
