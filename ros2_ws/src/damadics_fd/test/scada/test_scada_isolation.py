# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Isolation on the full plant at strengths that are on no grid."""

from types import SimpleNamespace

import numpy as np
import pytest
from damadics_fd.core.scada.learning import learn
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.core.scada.naming.isolation import GROUPS, NAMES, group_of
from damadics_fd.core.scada.naming.looks import Looks
from damadics_fd.core.scada.naming.names import Hypothesis, Isolation
from damadics_fd.core.scada.samples import scada_samples
from damadics_fd.core.scada.settings import ScadaSettings

plant = pytest.importorskip('damadics_plant')
SETTINGS = ScadaSettings(learn_s=1800.0)


def run(name, duration, seed):
    columns = plant.simulate(name, rate=1.0, duration=duration, noise=True, seed=seed)
    quiet = plant.simulate(name, rate=1.0, duration=duration, noise=False)
    samples = scada_samples(columns)
    samples[:, 1] = quiet['cv']
    return samples


@pytest.fixture(scope='module')
def reference():
    return learn(run('nominal', 1800.0, 77), SETTINGS)


CASES = (
    'f1@0.41',
    'f2@0.57',
    'f7@0.4',
    'f10@0.33',
    'f11@0.66',
    'f12@-0.44',
    'f13@0.19',
    'f15@0.5',
    'f16@0.58',
    'f17@0.3',
    'f18@0.27',
    'f19@-0.37',
)


@pytest.mark.parametrize('name', CASES)
def test_the_right_fault_comes_first(reference, name):
    fault, strength = int(name[1:].split('@')[0]), float(name.split('@')[1])
    monitor = ScadaMonitor(SETTINGS, reference)
    trace = monitor.run_samples(run(name, 1100.0, 5))
    assert not trace['alarm'][:900].any()
    assert trace['alarm'][-1]
    isolation = monitor.isolate()
    assert isolation.best.fault == fault
    assert isolation.group == group_of(fault)
    assert NAMES[fault] in isolation.text()
    if fault not in (7, 17):
        assert isolation.best.strength == pytest.approx(strength, abs=0.1)


def test_nothing_is_named_without_an_alarm(reference):
    monitor = ScadaMonitor(SETTINGS, reference)
    monitor.run_samples(run('nominal', 1000.0, 6))
    assert monitor.isolate() is None


def test_groups_cover_every_named_fault():
    listed = [fault for faults in GROUPS.values() for fault in faults]
    assert sorted(listed) == sorted(NAMES)
    assert group_of(8) == group_of(14) == 'not observable'


def test_isolation_does_not_touch_the_monitor(reference):
    monitor = ScadaMonitor(SETTINGS, reference)
    monitor.run_samples(run('f18@0.27', 1000.0, 5))
    before = monitor._state.tobytes()
    first, again = monitor.isolate(), monitor.isolate()
    assert monitor._state.tobytes() == before
    assert first == again
    assert np.isfinite([h.cost for h in first.ranking]).all()


class Monitor:
    """Stands for a monitor whose flow meter comes to the end of its range."""

    def __init__(self, *rankings) -> None:
        self.reference = True
        self.rankings = list(rankings)
        self.state = SimpleNamespace(
            occurrence=1, t=1000.0, t_raised=1000.0, t_onset=999.0, test=0
        )

    def isolate(self):
        return self.rankings.pop(0)


def ranked(fault, other, *, ended):
    ranking = (Hypothesis(fault, 0.4, 0.0), Hypothesis(other, 0.3, 9.0))
    return Isolation(1000.0, 600, ranking, flow_ended=ended)


def test_a_saturated_flow_meter_does_not_replace_what_was_known():
    monitor = Monitor(
        ranked(13, 18, ended=False), ranked(18, 13, ended=True), ranked(1, 4, ended=True)
    )
    looks = Looks()
    told = []
    for after in (0.0, 10.0, 60.0, 600.0):
        monitor.state.t = 1000.0 + after
        told.append(looks.judge(monitor).candidates)
    assert told == [(), ('f13',), ('f13',), ('f1',)]  # the stem is seen whatever the flow shows
