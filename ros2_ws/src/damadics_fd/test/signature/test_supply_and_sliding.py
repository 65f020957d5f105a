# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What strokes tell of the air supply, and stairs of a stem that sticks and slips."""

import numpy as np
import pytest
from damadics_fd.core.signature import air, sliding
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import FILL, STROKES, VENT, State

SUPPLY, ATM = 6e5, 101325.0


def strokes(law, now: float, at: float) -> tuple[State, SignatureSettings]:
    """Return rates learned at 600 kPa and taken at another supply, of a given law of flow."""
    state, settings = State.rows(), SignatureSettings().record()
    s, c = state[0], settings[0]
    for way in (FILL, VENT):
        s.air_learned[way], s.air_count[way] = STROKES, STROKES
        s.air_rate[way], s.air_rate_ps[way] = 1.0, at
    s.air_rate[FILL] = law(now, at) / law(SUPPLY, at)
    return s, c


def root(supply: float, ps: float) -> float:
    return float(np.sqrt(supply - ps))


def iso(supply: float, ps: float) -> float:
    return float(np.sqrt(air.flow_square(ATM + supply, ATM + ps)))


@pytest.mark.plain
@pytest.mark.parametrize('law', [root, iso])
@pytest.mark.parametrize('ps', [5e4, 1.5e5, 3e5])
def test_a_loss_of_a_tenth_is_no_alarm_whatever_the_law_of_the_flow(law, ps):
    s, c = strokes(law, 0.9 * SUPPLY, ps)
    assert air.supply_change(s, c) == pytest.approx(-0.1 * SUPPLY, abs=2.0e4)
    assert not air.supply_lost(s, c)
    now = 5e5 if ps > 1e5 else 4.7e5
    s, c = strokes(law, now, ps)
    assert air.supply_change(s, c) == pytest.approx(now - SUPPLY, abs=4e4)
    assert air.supply_lost(s, c)
    s.air_rate[VENT] = 1.2  # a leak vents faster
    assert not air.supply_lost(s, c)


@pytest.mark.plain
@pytest.mark.parametrize(('law', 'change'), [(root, air.by_root), (iso, air.by_sonic)])
@pytest.mark.parametrize('learned_at', [1.2e5, 1.8e5])
def test_a_rate_taken_at_another_pressure_is_judged_by_each_law(law, change, learned_at):
    at, now = 1.5e5, 0.89 * SUPPLY
    s, c = strokes(law, now, at)
    s.air_ref_ps[FILL] = learned_at
    rate = law(now, at) / root(SUPPLY, at)
    learned = law(SUPPLY, learned_at) / root(SUPPLY, learned_at)
    s.air_rate[FILL] = rate / learned * air.elsewhere(c, FILL, at, learned_at)
    assert change(s, c) == pytest.approx(now - SUPPLY, abs=200.0)
    assert not air.supply_lost(s, c)


@pytest.mark.plain
def test_strokes_compare_with_all_that_were_learned_not_with_the_one_of_highest_pressure():
    state, settings = State.rows(), SignatureSettings().record()
    s, c = state[0], settings[0]
    far = air.swing(c)  # by which the highest of the learned strokes stands out

    def stroke(way: int, supply: float, ps: float, of: float = 1.0) -> None:
        flow, drive = (iso(supply, ps), SUPPLY - ps) if way == FILL else (iso(ps, 0.0), ps)
        s.air_way, s.air_moved, s.air_ps = way, 0.5, ps
        s.air_second = of * flow / np.sqrt(drive)
        air.end_stroke(s, c, True)

    for way in (FILL, VENT):
        for ps, of in ((1.3, 1.0), (1.9, 1.002), (1.3, 1.003), (1.35, 0.999), (1.4, 1.0)):
            stroke(way, SUPPLY, 1e5 + (ps - 1.3) * far, of)
        assert s.air_ref_ps[way] == pytest.approx(1e5 + 0.15 * far)
    for way in (FILL, VENT):
        for k in range(STROKES):
            stroke(way, 4e5, 1e5 + 0.02 * k * far)
    assert s.air_count.tolist() == [STROKES, STROKES]
    assert air.supply_change(s, c) == pytest.approx(-2e5, abs=4e4)
    assert air.supply_lost(s, c)


@pytest.mark.plain
@pytest.mark.parametrize('up', [7e5, 3e5])
@pytest.mark.parametrize('down', [1e5, 2e5, 2.5e5])
def test_the_flow_law_is_inverted(up, down):
    assert air.supply_of(air.flow_square(up, down), down) == pytest.approx(up, rel=1e-9)


@pytest.mark.plain
def test_a_spike_and_a_short_stroke_do_not_move_the_rate():
    values = np.array([0.7, 1.0, 0.98, 3.0, 0.99])
    assert values[air.second_best(values, 5)] == 1.0
    assert air.second_best(values, 1) == 0


@pytest.mark.parametrize('lag', [0.0, 0.1])
def test_stairs_are_told_from_an_even_motion(lag):
    """The stem goes a fifth of its stroke a second, evenly and then by stairs of 1.3 %."""
    from damadics_fd.core.approximator.transmitter import delay_column
    from damadics_fd.core.signature.blocks import add_sample, close_block, open_block

    settings = SignatureSettings(ps_lag=lag).record()
    state = State.rows()
    s, c = state[0], settings[0]
    t = np.arange(800) * 0.005
    even = 0.1 + 0.2 * t
    x = np.where(t < 2.0, even, np.floor(even / 0.013) * 0.013)
    x = x + 3e-4 * np.random.default_rng(1).standard_normal(len(t))
    if lag:
        x = delay_column(x, np.full(len(t), 0.005), lag)
    told = []
    s.index = -1
    for k in range(len(t)):
        index = int(t[k] / 0.1 + 1e-9)
        if index != s.index:
            if s.index >= 0 and close_block(s, c):
                told.append(sliding.sticks(s, c, 0.2))
            open_block(s, index)
        add_sample(s, c, t[k], x[k], 1e5, 1e6)
    assert not any(told[3:17])
    assert all(told[22:])
