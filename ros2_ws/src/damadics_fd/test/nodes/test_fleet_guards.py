# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The guards of a fleet do for each of its valves what those of a single node do."""

import numpy as np
import pytest

pytest.importorskip('damadics_msgs.msg')
from damadics_fd.core.stamps import DATE, SECOND
from damadics_fd.nodes.fleet.ages import Ages
from damadics_fd.nodes.fleet.blocks import Rows
from damadics_fd.nodes.fleet.jumps import Jumps
from damadics_fd.ros.freshness import ForwardJumps, Freshness

VALVES = 3


def streams(seed, start):
    """Blocks of some valves: even samples, pauses, queues, restarts of the run, wrong stamps."""
    random = np.random.default_rng(seed)
    steady, stamp = 50.0, np.full(VALVES, start, np.int64)
    for _ in range(400):
        gap = random.choice(
            [0.1, 0.1, 0.1, 0.1, 0.5, 4.0, 90.0], p=[0.3, 0.3, 0.2, 0.1, 0.06, 0.03, 0.01]
        )
        steady += gap
        valve = np.flatnonzero(random.random(VALVES) < 0.8)
        step = random.choice([gap, gap, gap, 0.1, 0.0], VALVES)
        stamp = stamp + (step * SECOND).astype(np.int64)
        if random.random() < 0.01:
            stamp[random.integers(VALVES)] = start
        sent = stamp[valve].copy()
        if len(valve) and random.random() < 0.05:
            sent[random.integers(len(valve))] += int(random.choice([70, 1000, 10**9])) * SECOND
        yield valve, sent, steady


@pytest.mark.parametrize('start', [0, 2 * DATE])
@pytest.mark.parametrize('seed', range(4))
def test_ages_are_those_of_single_valves(seed, start):
    ages = Ages(np.full(VALVES, 0.1), simulated=False)
    single = [Freshness() for _ in range(VALVES)]
    for valve, stamp, steady in streams(seed, start):
        ages.heard(valve, stamp, steady)
        for v, at in zip(valve.tolist(), stamp.tolist(), strict=True):
            single[v].heard(at, steady)
        clock = start + int(steady * SECOND)
        wanted = [one.age(clock, steady + 0.05) for one in single]
        found = np.nan_to_num(ages.ages(clock, steady + 0.05), nan=np.inf)
        assert found == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize('seed', range(6))
def test_jumps_are_held_as_those_of_single_valves(seed):
    jumps = Jumps(VALVES)
    single = [ForwardJumps() for _ in range(VALVES)]
    for n, (valve, stamp, steady) in enumerate(streams(seed, 0)):
        signals = {'cv': stamp * 1e-9} | ({'x1': valve * 1.0} if n % 2 else {})
        admitted = jumps.admit(Rows(valve, stamp, signals), steady)
        for v in range(VALVES):
            wanted = [
                a for at in stamp[valve == v].tolist() for a in single[v].admit(at, at, steady)
            ]
            assert admitted.stamp[admitted.valve == v].tolist() == wanted
        assert admitted.signals['cv'] == pytest.approx(admitted.stamp * 1e-9)
        assert jumps.refused == sum(one.refused for one in single)
        assert all(len(column) == len(admitted.valve) for column in admitted.signals.values())


def test_a_late_block_of_many_minutes_is_no_jump():
    jumps = Jumps(1)
    one = np.zeros(1, np.int64)
    jumps.admit(Rows(one, one + SECOND, {}), 0.0)
    stamps = np.arange(2, 302) * SECOND  # at 1 Hz, all at once
    late = jumps.admit(Rows(np.zeros(300, np.int64), stamps, {}), 1.0)
    assert late.stamp.tolist() == stamps.tolist()
    assert jumps.refused == 0
