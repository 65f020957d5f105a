# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Paper mode, and one core for single samples and for columns."""

import math
import subprocess
import sys

import numpy as np
import pytest
from damadics_fd.core import monitor
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.decision.events import Decision
from damadics_fd.core.monitor import Chain, run
from damadics_fd.core.quality import Refused
from damadics_fd.core.settings import Settings


def recording(n=4000, rate=400.0, seed=1):
    """A moving stem with bad samples in between."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / rate
    x1 = 0.5 + 0.3 * np.sin(2.0 * t) + 1e-3 * rng.standard_normal(n)
    columns = {
        'stamp': (t * 1e9).astype(np.int64),
        'cv': np.where(np.sin(2 * t) > 0, 1.0, 0.0),
        'x1': x1,
        'p1': np.full(n, 3.5e6),
        'p2': np.full(n, 2.6e6),
        't1': np.full(n, 20.0),
        'flow': np.full(n, 8.0),
        'ps': 2e5 + 6e4 * np.sin(2.0 * t),
    }
    columns['x1'][100] = math.nan
    columns['cv'][200:203] = math.inf
    columns['x1'][300] = 1.3
    columns['stamp'][400] = columns['stamp'][399]
    columns['stamp'][500] = columns['stamp'][490]
    return columns


@pytest.mark.parametrize('mode', ['paper', 'monitor'])
def test_single_samples_and_columns_agree_bit_for_bit(mode):
    columns = recording()
    settings = (
        Settings.for_mode(mode, sample_rate=400.0, t_on=1.0, t_w=2.0, t_learn=5.0)
        if mode == 'monitor'
        else Settings.for_mode(mode)
    )
    result = run(columns, settings)
    estimator, detector = Estimator(settings), Detector(settings)
    names = ('stamp', 'cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps')
    for row in range(len(columns['stamp'])):
        estimate = estimator.update(*(columns[name][row].item() for name in names))
        assert isinstance(estimate, Refused) != result.accepted[row]
        if result.accepted[row]:
            assert Estimate(*result.estimates[row].item()) == estimate
            assert Decision(*result.decisions[row].item()) == detector.update(estimate)
    assert estimator.counters == result.counters
    assert estimator.state.tobytes() == result.estimator.state.tobytes()
    assert result.counters['not_finite'] == 4
    assert result.counters['out_of_range'] == 1
    assert result.counters['duplicate'] == 1
    assert result.counters['out_of_order'] == 1


def test_chunks_agree_with_the_whole():
    columns, settings = recording(), Settings.for_mode('paper')
    whole = run(columns, settings)
    first = run({name: c[:1500] for name, c in columns.items()}, settings)
    second = run(
        {name: c[1500:] for name, c in columns.items()}, settings, first.estimator, first.detector
    )
    joined = np.concatenate([first.decisions, second.decisions])
    for name in joined.dtype.names:  # not the bytes: there is padding between the fields
        np.testing.assert_array_equal(joined[name], whole.decisions[name])


@pytest.mark.parametrize('mode', ['paper', 'monitor'])
def test_watching_gives_the_events_and_the_states_of_a_run(mode, monkeypatch):
    settings = Settings.for_mode(mode, sample_rate=400.0)
    columns = recording()
    columns['x1'][1500:] += np.where(np.arange(2500) % 40 < 20, 0.2, 0.0)
    result = run(columns, settings)
    assert len(result.events) > 5 or mode == 'monitor'
    monkeypatch.setattr(monitor, 'ROOM', 3)  # several turns
    estimator, detector = Estimator(settings), Detector(settings)
    chain = Chain(settings, estimator=estimator, detector=detector)
    assert chain.events(columns) == result.events
    assert detector.decision == result.detector.decision
    assert estimator.counters == result.counters
    for mine, other in (
        (estimator, result.estimator),
        (detector, result.detector),
        (detector.signature, result.detector.signature),
    ):
        assert mine.state.tobytes() == other.state.tobytes()


def test_core_imports_no_ros_package():
    code = (
        'import sys, pkgutil, damadics_fd.core as core\n'
        'for m in pkgutil.walk_packages(core.__path__, core.__name__ + "."):\n'
        '    __import__(m.name)\n'
        'print(*{n.split(".")[0] for n in sys.modules})'
    )
    names = subprocess.run(
        [sys.executable, '-c', code],
        capture_output=True,
        text=True,
        check=True,
        env={'PYTHONPATH': ':'.join(sys.path)},
    ).stdout.split()
    found = {n for n in names if n.startswith(('rclpy', 'rosidl', 'std_msgs', 'damadics_'))}
    assert found == {'damadics_fd'}


def test_plain_python_gives_the_same_numbers():
    """The same source runs uncompiled, equal to the last bits of exp and sin."""
    code = (
        'import sys; sys.path[:0] = [sys.argv[1]]\n'
        'import numpy as np\n'
        'from test_paper import recording\n'
        'from damadics_fd.core.monitor import run\n'
        'from damadics_fd.core.settings import Settings\n'
        'r = run(recording(700), Settings.for_mode("paper"))\n'
        'total = float(np.nansum(np.abs(r.estimates["xi2"])))\n'
        'print(repr(total), r.decisions["fault"].sum())'
    )
    here = str(__import__('pathlib').Path(__file__).parent)
    outputs = []
    for disable in ('0', '1'):
        done = subprocess.run(
            [sys.executable, '-c', code, here],
            capture_output=True,
            text=True,
            check=True,
            env={'PYTHONPATH': ':'.join(sys.path), 'NUMBA_DISABLE_JIT': disable},
        )
        outputs.append([float(v) for v in done.stdout.split()])
    assert outputs[0] == pytest.approx(outputs[1], rel=1e-9)


def test_the_printed_observer_stays_stable_when_phi_has_drifted():
    settings, columns = Settings.for_mode('paper'), recording(4000, rate=200.0)
    estimator = Estimator(settings)
    estimator.state['b1'] = 500.0  # Phi/delta is 10 000 1/s: 25 per step of 2.5 ms
    result = run(columns, settings, estimator)
    assert np.nanmax(np.abs(result.estimates['xi2'])) < 0.1
    assert np.nanmax(np.abs(result.estimates['xi1'])) < 0.1
