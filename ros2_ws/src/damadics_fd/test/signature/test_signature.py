# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
The signature on a force balance written down here, without any plant model.

The stem follows random set-points at limited speed; the chamber pressure is what the balance
asks for. Sensor noise and hum are those of the benchmark.
"""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.core.signature import state as st
from damadics_fd.core.signature.air.strokes import strokes_agree
from damadics_fd.core.signature.settings import SignatureSettings
from damadics_fd.core.signature.signature import Signature
from damadics_fd.core.signature.state import CAUSES
from damadics_fd.core.signature.step import BLOCK, CHANGED, QUIET
from damadics_fd.core.valve.plug import POSITION, recoveries

from .balance import chamber_pressure
from .feed import feed

DT = 0.005
C = SignatureSettings()


@cache
def motion(seed: int, seconds: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    n = round(seconds / DT)
    target = np.zeros(n)
    k = 0
    while k < n:
        length = int(rng.uniform(5.0, 9.0) / DT)
        target[k : k + length] = rng.uniform()
        k += length
    x = np.empty(n)
    now, speed = 0.5, 0.0
    for i in range(n):
        wanted = min(max(3.0 * (target[i] - now), -0.15), 0.12)
        speed += DT / 0.1 * ((wanted if abs(wanted) > 0.02 else 0.0) - speed)
        now += speed * DT
        x[i] = now
    return x


def valve(
    seed=0,
    seconds=260.0,
    t_fault=150.0,
    dK=0.0,
    dF=0.0,
    gain=0.0,
    shape=0.0,
    preload=0.0,
    position=(0.0, 0.0),
    pressure=0.0,
    dp_offset=0.0,
    one_way=0.0,
):
    """Columns of a run: force balance with a fault from t_fault on, plug error from the start."""
    x = motion(seed, seconds)
    rng = np.random.default_rng(seed + 1000)
    t = np.arange(len(x)) * DT
    after = t >= t_fault
    v = np.gradient(x, DT)
    dp = 0.9e6 * (1.0 + 0.04 * np.sin(0.6 * t))
    table = np.asarray(C.plug_km) / (1.0 + gain + shape * np.sin(5.0 * np.asarray(POSITION)))
    preload = preload * after + one_way * 0.0108 * (1.0 + dF * after)
    ps = chamber_pressure(C, x, v, dp, dK * after, dF * after, preload, table=table)
    x = x * (1.0 + position[0] * after) + position[1] * after
    x = x + 1.41e-3 * rng.standard_normal(len(x)) + 2.5e-3 * np.sin(2 * np.pi * 50.0 * t)
    ps = ps * (1.0 + pressure * after) + 80.0 * rng.standard_normal(len(x))
    return np.arange(len(x)) * 5_000_000, x, ps, dp + dp_offset * after


def run(columns, signature=None, alarm_at=np.inf, keep=slice(None)):
    signature = signature or Signature(C)
    return signature, feed(signature, *(column[keep] for column in columns), alarm_at)


def test_a_healthy_valve_is_learned_verified_and_left_alone():
    signature, results = run(valve())
    s = signature.state[0]
    assert signature.view().state == st.STATE_MONITOR and signature.view().cause == 'none'
    assert signature.progress == 1.0
    assert np.sum(results == CHANGED) == 2  # LEARN to VERIFY to MONITOR
    assert s.kappa < 1.2 and s.d_max.max() < 15.0
    assert abs(s.theta[st.SIGN] - 0.0108) < 0.003
    assert 5e-4 < s.sigma < 1.2e-3


@pytest.mark.parametrize(
    'change, cause, truth, tolerance',
    [
        ({'dF': -0.5}, 'friction_down', -0.5, 0.15),
        ({'dF': 1.0}, 'friction_up', 1.0, 0.2),
        ({'dK': 0.03}, 'spring_stiffer', 0.03, 0.005),
        ({'dK': -0.03}, 'spring_softer', -0.03, 0.005),
        ({'preload': 0.06}, 'preload', 0.06 * C.force_scale, 15.0),
        ({'position': (0.05, 0.0)}, 'position_gain', 0.05, 0.006),
        ({'position': (0.0, -0.03)}, 'position_offset', -0.03, 0.004),
        ({'pressure': -0.05}, 'pressure_gain', -0.05, 0.006),
        ({'dp_offset': 50e3}, 'dp_offset', 50e3, 6e3),
    ],
)
def test_a_change_is_found_named_and_sized(change, cause, truth, tolerance):
    signature, _ = run(valve(seed=3, seconds=330.0, **change))
    view = signature.view()
    assert signature.state['own'][0] == 1
    assert view.cause == cause
    assert view.value == pytest.approx(truth, abs=tolerance)
    assert view.confidence > 0.95


def test_friction_that_is_larger_one_way_does_not_turn_its_size():
    signature, _ = run(valve(seed=3, seconds=330.0, dF=2.0, one_way=0.3))
    view = signature.view()
    assert view.cause == 'friction_up'
    assert view.value == pytest.approx(2.0, rel=0.05)
    assert abs(view.value - 2.0) < 2.0 * view.std


def test_a_preload_that_is_not_the_true_one_does_not_turn_the_spring():
    signature = Signature(replace(C, preload=C.preload + 0.03))
    run(valve(seed=3, seconds=330.0, dK=-0.2), signature)
    view = signature.view()
    assert view.cause == 'spring_softer'
    assert view.value == pytest.approx(-0.2, rel=0.02)
    assert abs(view.value + 0.2) < 2.0 * view.std


def test_a_block_in_which_the_stem_jumps_and_stops_is_no_steady_motion():
    t = np.arange(8000) * DT
    phase = np.mod(t - 0.05, 1.0)  # jumps of 0.08 s that begin and end within a block
    step = np.clip(phase / 0.08, 0.0, 1.0)
    up = np.floor(t - 0.05) % 2 == 0
    x = 0.5 + 0.1 * np.where(up, step, 1.0 - step)
    ps = (x + C.preload) * C.force_scale / C.diaphragm_area
    signature, _ = run((np.arange(len(t)) * 5_000_000, x, ps, np.zeros(len(t))))
    assert signature.state['index'][0] > 300
    assert (signature.state['n_up'][0], signature.state['n_down'][0]) == (0, 0)


def test_a_wrong_plug_force_table_is_learned_and_raises_no_alarm():
    for error in ({'gain': 0.03}, {'gain': -0.03}, {'shape': 0.01}):
        signature, _ = run(valve(seed=4, **error))
        assert signature.view().state == st.STATE_MONITOR, error
    literal = SignatureSettings(plug_gain_std=1e-6, plug_shape_std=1e-6)
    signature, _ = run(valve(seed=4, gain=0.03), Signature(literal))
    fixed = signature.state[0]
    assert fixed.own == 1 or fixed.kappa > 1.0, 'a fixed table does not fit: learning it matters'


def test_an_alarm_of_the_approximator_is_explained_during_verification():
    signature, _ = run(valve(seed=5, seconds=130.0, t_fault=80.0, dK=0.2), alarm_at=80.05)
    assert signature.view().family == st.FAMILY_ELASTIC
    assert signature.state['own'][0] == 0


def test_an_unfounded_alarm_is_called_unconfirmed_and_can_be_cleared():
    columns = valve(seed=6)
    signature, _ = run(columns, alarm_at=130.0, keep=slice(0, -200))
    assert signature.view().cause == 'unconfirmed'
    run(columns, signature, keep=slice(-200, None))
    assert signature.view().state == st.STATE_MONITOR and signature.view().cause == 'none'


def test_learning_starts_again_after_an_alarm_and_wants_motion():
    columns = valve(seed=7, seconds=130.0)
    signature, _ = run(columns, alarm_at=40.0)
    assert signature.view().state in (st.STATE_LEARN, st.STATE_INSUFFICIENT)
    assert signature.progress == 0.0
    still = (columns[0], np.full_like(columns[1], 0.5), columns[2] * 0 + 1e5, columns[3])
    signature, _ = run(still)
    assert signature.view().state == st.STATE_INSUFFICIENT and signature.progress == 0.0


def test_a_saved_reference_continues_where_it_was():
    columns = valve(seed=8, dK=-0.03, seconds=330.0)
    learned, _ = run(columns, keep=slice(0, 28000))
    restarted = Signature(C)
    restarted.load(json.loads(json.dumps(learned.save())))
    assert restarted.view().state == st.STATE_MONITOR
    run(columns, restarted, keep=slice(28000, None))
    assert restarted.view().cause == 'spring_softer'
    good = learned.save()
    assert Signature(C).save() == {}
    before = restarted.state.tobytes()
    for wrong in (
        {**good, 'theta': [1.0]},
        {**good, 'sigma': 0.0},
        {'theta': 1},
        {},
        {**good, 'J0': 'x'},
        {**good, 'sigma': np.nan},
    ):
        with pytest.raises(ValueError, match='signature reference'):
            restarted.load(wrong)
    assert restarted.state.tobytes() == before


def test_pressures_that_are_measured_late_do_not_pass_for_friction():
    stamp, x, ps, dp = valve(seed=4)
    lag = 0.02
    swing = 0.15e6 * np.sin(2 * np.pi * 0.1 * stamp * 1e-9)
    late = 0.15e6 * np.sin(2 * np.pi * 0.1 * (stamp * 1e-9 - lag))
    ps = ps + swing * C.plug_area / recoveries(C.plug_km, x) / C.diaphragm_area
    signature, _ = run((stamp, x, ps, dp + late))
    s = signature.state[0]
    assert signature.view().cause == 'none'
    assert s.theta[st.LAG] == pytest.approx(lag, abs=0.004)
    plain = run(valve(seed=4))[0].state[0]
    assert s.theta[st.SIGN] == pytest.approx(plain.theta[st.SIGN], rel=0.03)
    assert s.sigma < 1.15 * plain.sigma


def test_the_unit_of_sizes_is_refined_without_moving_what_alarms_rest_on():
    columns = valve(seconds=420.0, t_fault=330.0, dF=3.0)
    before, _ = run(columns, keep=slice(0, 28000))
    early = before.state[0].copy()
    assert early.state == st.STATE_MONITOR
    np.testing.assert_allclose(early.unit, early.theta[:4], atol=5e-3)
    signature, _ = run(columns, before, keep=slice(28000, None))
    s = signature.state[0]
    assert s.theta.tolist() == early.theta.tolist() and s.J0.tolist() == early.J0.tolist()
    assert s.unit_weight >= 1.5 * early.unit_weight
    assert np.all(np.diag(s.unit_cov) < 0.8 * np.diag(early.unit_cov))
    view = signature.view()
    assert view.cause == 'friction_up' and view.value == pytest.approx(3.0, abs=0.15)
    relative = np.sqrt(s.unit_cov[st.SIGN, st.SIGN]) / s.unit[st.SIGN]
    assert view.std > 3.0 * 0.5 * relative, 'a share is no better known than its unit'


def test_missing_samples_cost_blocks_not_truth():
    columns = valve(seed=9, seconds=330.0, dF=1.0)
    rng = np.random.default_rng(0)
    keep = np.flatnonzero(rng.random(len(columns[0])) > 0.1)
    signature, _ = run(columns, keep=keep)
    assert signature.view().cause == 'friction_up'
    half = np.flatnonzero(rng.random(len(columns[0])) > 0.5)
    signature, results = run(columns, keep=half)
    assert signature.view().state in (st.STATE_LEARN, st.STATE_INSUFFICIENT)
    assert np.all(results == QUIET) or np.mean(results == BLOCK) < 0.01


def test_slow_ramps_are_not_taken_for_a_loss_of_supply():
    signature = Signature(C)
    s, c = signature.state[0], signature.record[0]
    s.air_ring[st.FILL, st.RATE] = 0.88, 0.87, 0.86, 0.89, 0.88
    assert strokes_agree(s, c)
    s.air_ring[st.FILL, st.RATE] = 0.88, 0.87, 0.86, 0.64, 0.88  # one was too short
    assert strokes_agree(s, c)
    s.air_ring[st.FILL, st.RATE] = (
        0.80,
        0.64,
        0.87,
        0.77,
        0.63,
    )  # the positioner did not open fully
    assert not strokes_agree(s, c)


def test_no_chamber_pressure_no_signature():
    columns = list(valve(seconds=20.0))
    columns[2] = np.full_like(columns[2], np.nan)
    signature, results = run(columns)
    assert signature.view().state == st.STATE_UNAVAILABLE and not results.any()


def test_old_stamps_change_nothing():
    columns = valve(seconds=20.0)
    signature, _ = run(columns)
    before = signature.state.tobytes()
    assert run(columns, signature, keep=slice(-10, -9))[1] == QUIET
    assert signature.state.tobytes() == before


def test_own_alarm_can_be_switched_off():
    signature, _ = run(valve(seed=3, dF=1.0), Signature(SignatureSettings(own_alarm=False)))
    assert signature.view().state == st.STATE_MONITOR
    assert signature.state['D'][0].max() > C.d_alarm


def test_bad_geometry_is_refused():
    with pytest.raises(ValueError, match='plug_km'):
        SignatureSettings(plug_km=(1.0,))
    with pytest.raises(ValueError, match='plug_km'):
        SignatureSettings(plug_km=(0.0,) * len(POSITION))
    with pytest.raises(ValueError, match='force_scale'):
        SignatureSettings(force_scale=-1.0)


def test_messages_name_the_same_numbers():
    message = Path(__file__).parents[3].joinpath('damadics_msgs/msg/Signature.msg').read_text()
    for prefix, names in (('CAUSE_', CAUSES), ('STATE_', ()), ('FAMILY_', ())):
        stated = {
            line.split()[1]: int(line.split('=')[1].split('#')[0])
            for line in message.splitlines()
            if line.startswith(f'uint8 {prefix}')
        }
        assert stated
        for name, number in stated.items():
            assert getattr(st, name) == number
        for number, name in enumerate(names):
            assert stated[prefix + name.upper()] == number
