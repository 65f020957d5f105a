# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""References of a fleet: saved when learned, not when loaded, and never in the samples' way."""

import logging
from types import SimpleNamespace

import numpy as np
import pytest
from damadics_fd.causes import load_causes
from damadics_fd.core.modes import PHASE_HOLD, PHASE_MONITOR
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings

pytest.importorskip('damadics_msgs.msg')
from damadics_fd.nodes.fleet.ages import Ages
from damadics_fd.nodes.fleet.blocks import Rows
from damadics_fd.nodes.fleet.keeping import Keeping
from damadics_fd.nodes.fleet.members import Member, Members
from damadics_fd.nodes.fleet.telling import Telling
from damadics_plant import simulate

VALVES = 3


class Wire:
    """Stands for node and entities: nobody hears what is published."""

    def publisher(self, kind, topic, profile):
        class Publisher:
            publish = staticmethod(lambda message: None)

        return Publisher

    def get_logger(self):
        return logging.getLogger('fleet')


@pytest.fixture(scope='module')
def columns():
    return simulate('nominal', rate=1.0, duration=1500.0, noise=True, seed=7).columns


def fleet(folder):
    settings = Settings.for_mode('scada')
    members = Members(
        [Member(f'/lv{n}', f'LV-{n}', '', settings, folder / f'lv{n}', '') for n in range(VALVES)]
    )
    wire = Wire()
    keeping = Keeping(wire, members, None)
    ages = Ages(np.ones(VALVES), False, 0.0)
    none = SimpleNamespace(under_way=set())
    return members, keeping, Telling(wire, wire, members, keeping, ages, load_causes(), none)


def judge(telling, columns, first, end):
    stamp = np.tile(columns['stamp'][first:end], VALVES)
    signals = {name: np.tile(columns[name][first:end], VALVES) for name in SIGNALS}
    telling.judge(Rows(np.repeat(np.arange(VALVES), end - first), stamp, signals))


def files(folder):
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}


def test_what_was_loaded_is_not_saved_again(columns, tmp_path):
    _, keeping, telling = fleet(tmp_path)
    judge(telling, columns, 0, 100)
    keeping.again()
    assert files(tmp_path) == {}
    judge(telling, columns, 100, 950)
    keeping.again(patience=60.0)
    saved = files(tmp_path)
    assert {name.split('.')[0] for name in saved} == {f'lv{n}' for n in range(VALVES)}
    keeping.again()
    assert files(tmp_path) == saved

    members, keeping, telling = fleet(tmp_path)
    keeping.restore()
    phases = set()
    for second in range(950, 1500, 10):
        judge(telling, columns, second, second + 10)
        keeping.again()
        phases.add(int(members.column('phase', np.int64, estimate=True)[0]))
    assert {PHASE_HOLD, PHASE_MONITOR} <= phases
    assert files(tmp_path) == saved


def test_saving_many_gives_way_to_the_samples_and_goes_on_later(columns, tmp_path):
    _, keeping, telling = fleet(tmp_path)
    judge(telling, columns, 0, 950)
    keeping.again(patience=0.0)
    assert len(files(tmp_path)) < VALVES
    for _ in range(VALVES):
        keeping.again(patience=1e-9)
    keeping.again(patience=60.0)
    assert len(files(tmp_path)) == VALVES
