# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Faults that follow the same law: the one of which most strengths would do comes first."""

import pytest
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.naming.isolation import Isolator
from damadics_fd.core.scada.samples import X

from .driven import SETTINGS, driven


@pytest.fixture(scope='module')
def reference():
    """Learn the stated actuator from four minutes."""
    return learn(driven(270, seed=1), SETTINGS)


@pytest.mark.parametrize(
    ('fault', 'strength', 'like'), [(3, 0.25, 19), (5, 0.5, 2), (5, 0.5, 19), (19, 0.3, 2)]
)
@pytest.mark.parametrize('seed', [31, 32, 33])
def test_like_faults_that_have_grown(reference, fault, strength, like, seed):
    monitor = ScadaMonitor(SETTINGS, reference)
    monitor.run_samples(driven(700, seed, 60, **{f'f{fault}': strength}))
    found = Isolator(monitor.record[0], reference[0]).isolate(monitor.state, abrupt=False)
    assert found.best.fault == fault
    assert found.best.strength == pytest.approx(strength, rel=0.2)
    costs = {h.fault: h.cost for h in found.ranking}
    assert costs[like] > costs[fault]


@pytest.mark.parametrize('seed', [31, 32, 33])
def test_a_stem_that_does_not_show_it_is_no_reason_against_a_fault_of_the_seat(reference, seed):
    """The flow pushes a plug on a changed seat by less than the model of the stem is known."""
    monitor = ScadaMonitor(SETTINGS, reference)
    record = driven(700, seed, 60, f2=0.4)
    record[:, X] = driven(700, seed)[:, X]
    monitor.run_samples(record)
    found = Isolator(monitor.record[0], reference[0]).isolate(monitor.state, abrupt=False)
    assert 2 in found.candidates
