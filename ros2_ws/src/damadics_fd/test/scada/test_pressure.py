# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a short record teaches of a pressure: its waves, and nothing of its noise."""

from dataclasses import replace

import numpy as np
import pytest
from damadics_fd.core.scada.judging.pressure import PRESSURE, innovation, learn_pressure
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor

from .driven import NOISE, SETTINGS, driven

MINUTES = 270
T, X, P1, P2 = 0, 2, 3, 4


def learned(pressure: np.ndarray):
    """Return the filter of a record."""
    filt = np.zeros(1, PRESSURE)
    learn_pressure(pressure, NOISE, filt[0])
    return filt[0]


def test_noise_has_hardly_anything_to_predict_it_by():
    rng = np.random.default_rng(1)
    taps = [np.count_nonzero(learned(0.5 + rng.normal(0.0, NOISE, MINUTES)).b) for _ in range(40)]
    assert np.mean(taps) < 1.0


@pytest.mark.parametrize('seed', range(5))
def test_a_wave_is_predicted_of_a_short_record_too(seed):
    rng = np.random.default_rng(seed)
    t = np.arange(2 * MINUTES)
    wave = 0.5 + 0.02 * np.sin(0.4 * t) + rng.normal(0.0, NOISE, t.size)
    filt = learned(wave[:MINUTES])
    past = [wave[k - 1 : k - 21 : -1] for k in range(MINUTES, t.size)]
    error = [innovation(filt, p, wave[k]) for p, k in zip(past, t[MINUTES:], strict=True)]
    assert np.std(error) < 2.0 * NOISE


@pytest.mark.parametrize('seed', [168, 173])
def test_a_pressure_learned_for_four_minutes_raises_nothing(seed):
    reference = learn(driven(MINUTES, seed=1), SETTINGS)
    trace = ScadaMonitor(SETTINGS, reference).run_samples(driven(2300, seed=seed))
    assert not trace['alarm'].any()


@pytest.mark.parametrize('missing', [5, 40])
@pytest.mark.parametrize('seed', range(3))
def test_a_wave_that_goes_on_after_a_gap_is_no_step(seed, missing):
    rows = driven(900, seed)
    wave = 0.05 * np.sin(0.4 * rows[:, T])
    rows[:, P1] += wave
    rows[:, P2] += wave
    settings = replace(SETTINGS, learn_s=500.0)
    reference = learn(rows[:530], settings)
    trace = ScadaMonitor(settings, reference).run_samples(
        np.delete(rows, np.s_[600 : 600 + missing], axis=0)
    )
    assert not trace['alarm'].any()


@pytest.mark.parametrize('second', [-0.2, -0.1])
def test_two_pressures_that_are_off_otherwise_do_not_throw_the_model(second):
    """A stem that is thrown to its stop loses air, and never answers as before."""
    rows = driven(900, seed=3)
    monitor = ScadaMonitor(SETTINGS, learn(rows[:300], SETTINGS))
    monitor.run_samples(rows[:600])
    rows[600:602, P1] += 0.2, second
    monitor.run_samples(rows[600:604])
    assert abs(float(monitor.state.xm[0]) - rows[603, X]) < 0.01
