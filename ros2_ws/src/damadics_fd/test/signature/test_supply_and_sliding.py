# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What strokes tell of the air supply, and stairs of a stem that sticks and slips."""

import numpy as np
import pytest
from damadics_fd.core.signature import sliding
from damadics_fd.core.signature.air import strokes as air
from damadics_fd.core.signature.air import supply
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.state import FILL, STROKES, VENT, State

SUPPLY, ATM = 6e5, 101325.0


def root(now: float, ps: float) -> float:
    return float(np.sqrt(now - ps))


def iso(now: float, ps: float) -> float:
    return float(np.sqrt(supply.flow_square(ATM + now, ATM + ps)))


def strokes(law, now: float, at: float) -> tuple[State, SignatureSettings]:
    """Return rates learned at 600 kPa and taken at another supply, of a law that is known."""
    state, settings = State.rows(), SignatureSettings().record()
    s, c = state[0], settings[0]
    for way in (FILL, VENT):
        s.air_learned[way], s.air_count[way] = STROKES, STROKES
        s.air_rate[way], s.air_rate_ps[way] = 1.0, at
        s.air_law[way] = 20.0, 1.0, float(law is iso), float(law is iso)
    s.air_rate[FILL] = law(now, at) / law(SUPPLY, at)
    return s, c


class Chamber:
    """Strokes at full opening, half a minute apart, at pressures that vary."""

    def __init__(self, law) -> None:
        self.state, self.settings = State.rows(), SignatureSettings().record()
        self.s, self.c, self.law = self.state[0], self.settings[0], law
        self.rng = np.random.default_rng(1)

    def stroke(self, way: int, now: float, ps: float, of: float = 1.0) -> None:
        """Fill or vent once."""
        s = self.s
        s.t += 15_000_000_000
        flow = self.law(now, ps) if way == FILL else self.law(ps, 0.0)
        s.air_way, s.air_moved, s.air_ps = way, 0.5, ps
        s.air_second = of * flow / np.sqrt(SUPPLY - ps if way == FILL else ps)
        air.end_stroke(s, self.c, True)

    def lost(self, now: float, times: int) -> bool:
        """Move both ways and tell whether a loss was told."""
        told = False
        for _ in range(times):
            for way in (FILL, VENT):
                ps, of = self.rng.uniform(1e5, 1.6e5), 1.0 + 0.004 * self.rng.standard_normal()
                self.stroke(way, now, ps, of)
            told |= bool(supply.supply_lost(self.s, self.c) and air.strokes_agree(self.s, self.c))
        return told


@pytest.mark.plain
@pytest.mark.parametrize('law', [root, iso])
@pytest.mark.parametrize('ps', [5e4, 1.5e5, 3e5])
def test_a_loss_of_a_tenth_is_no_alarm_whatever_the_law_of_the_flow(law, ps):
    s, c = strokes(law, 0.9 * SUPPLY, ps)
    supply.note_level(s, c, 1.0, ps)  # some minutes ago all was as learned
    assert supply.supply_change(s, c) == pytest.approx(-0.1 * SUPPLY, abs=1e3)
    assert not supply.supply_lost(s, c)
    s, c = strokes(law, 5e5, ps)
    assert supply.supply_change(s, c) == pytest.approx(-1e5, abs=1e3)
    assert not supply.supply_lost(s, c), 'slowly, as a supply that swings'
    supply.note_level(s, c, 1.0, ps)
    assert supply.supply_lost(s, c)
    s.air_rate[VENT] = 1.2  # a leak vents faster
    assert not supply.supply_lost(s, c)


@pytest.mark.plain
@pytest.mark.parametrize('law', [root, iso])
def test_the_rate_tells_a_loss_from_a_swing_learned_at_its_crest(law):
    swings = Chamber(law)
    assert not swings.lost(660e3, 12)
    assert not any(swings.lost(now, 2) for now in np.linspace(660e3, 540e3, 40))
    for before, after in ((600e3, 500e3), (540e3, 450e3)):
        loses = Chamber(law)
        assert not loses.lost(before, 12)
        assert loses.lost(after, 8)
    cycles = Chamber(law)
    assert not any(cycles.lost(now, 10) for now in (600e3, 540e3) * 10)


@pytest.mark.plain
@pytest.mark.parametrize('law', [root, iso])
def test_strokes_tell_the_law_of_the_flow(law):
    chamber = Chamber(law)
    assert supply.law_of(chamber.s, FILL) < 0.0, 'not known yet'
    chamber.lost(SUPPLY, 30)
    for way in (FILL, VENT):
        assert supply.law_of(chamber.s, way) == pytest.approx(float(law is iso), abs=0.15)


@pytest.mark.plain
def test_a_loss_between_two_strokes_is_not_taken_for_a_law():
    chamber = Chamber(root)
    chamber.lost(SUPPLY, 12)
    chamber.stroke(FILL, SUPPLY, 2.2e5)
    chamber.stroke(FILL, 5e5, 1e5)
    assert 0.0 <= supply.law_of(chamber.s, FILL) < 0.1


@pytest.mark.plain
def test_a_loss_that_stands_is_told_again_after_a_reset():
    chamber = Chamber(iso)
    chamber.lost(SUPPLY, 12)
    chamber.lost(5e5, 6)
    air.restart_air(chamber.s)
    assert chamber.lost(5e5, STROKES)


@pytest.mark.plain
@pytest.mark.parametrize(('law', 'change'), [(root, supply.by_root), (iso, supply.by_sonic)])
@pytest.mark.parametrize('learned_at', [1.2e5, 1.8e5])
@pytest.mark.parametrize('known', [True, False])
def test_a_rate_taken_at_another_pressure_is_judged_by_each_law(law, change, learned_at, known):
    at, now = 1.5e5, 0.89 * SUPPLY
    s, c = strokes(law, now, at)
    if not known:
        s.air_law[:] = 0.0
    s.air_ref_ps[FILL] = learned_at
    rate = law(now, at) / root(SUPPLY, at)
    learned = law(SUPPLY, learned_at) / root(SUPPLY, learned_at)
    s.air_rate[FILL] = rate / learned * supply.elsewhere(s, c, FILL, at, learned_at)
    assert change(s, c, s.air_rate[FILL], at) == pytest.approx(now - SUPPLY, abs=200.0)
    assert not supply.supply_lost(s, c)


@pytest.mark.plain
def test_strokes_compare_with_all_that_were_learned_not_with_the_one_of_highest_pressure():
    chamber = Chamber(iso)
    s, c = chamber.s, chamber.c
    far = air.swing(c)  # by which the highest of the learned strokes stands out
    for way in (FILL, VENT):
        for ps, of in ((1.3, 1.0), (1.9, 1.002), (1.3, 1.003), (1.35, 0.999), (1.4, 1.0)):
            chamber.stroke(way, SUPPLY, 1e5 + (ps - 1.3) * far, of)
        assert s.air_ref_ps[way] == pytest.approx(1e5 + 0.15 * far)
    for way in (FILL, VENT):
        for k in range(STROKES):
            chamber.stroke(way, 4e5, 1e5 + 0.02 * k * far)
    assert s.air_count.tolist() == [STROKES, STROKES]
    assert supply.supply_change(s, c) == pytest.approx(-2e5, abs=4e4)
    assert supply.supply_lost(s, c)


@pytest.mark.plain
@pytest.mark.parametrize('up', [7e5, 3e5])
@pytest.mark.parametrize('down', [1e5, 2e5, 2.5e5])
def test_the_flow_law_is_inverted(up, down):
    assert supply.supply_of(supply.flow_square(up, down), down) == pytest.approx(up, rel=1e-9)


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
