# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A fleet tells causes of valves in mode scada in its events, as a detector does."""

from types import SimpleNamespace

import numpy as np
import pytest
from damadics_fd.causes import load_causes
from damadics_fd.core.sample import SIGNALS
from damadics_fd.core.settings import Settings
from damadics_fd.core.stamps import SECOND

pytest.importorskip('damadics_msgs.msg')
from damadics_fd.nodes.fleet.ages import Ages
from damadics_fd.nodes.fleet.blocks import Rows
from damadics_fd.nodes.fleet.keeping import Keeping
from damadics_fd.nodes.fleet.members import Member, Members
from damadics_fd.nodes.fleet.telling import Telling
from damadics_msgs.msg import FaultEvent, FleetEvent, FleetIsolation
from damadics_plant import simulate

PIECE = 20  # samples of a block


class Wire:
    """Stands for node and entities: keeps what is published, by type."""

    def __init__(self) -> None:
        self.sent = {}

    def publisher(self, kind, topic, profile):
        self.kind = kind
        mine = self.sent.setdefault(kind, [])

        class Publisher:
            publish = staticmethod(mine.append)

        return Publisher


def test_the_cause_comes_with_the_events_of_the_valve():
    run = simulate('f11@0.5', rate=1.0, duration=1000.0, noise=True, seed=4).columns
    members = Members([Member('/lv1', 'LV-1', '', Settings.for_mode('scada'), None, '')])
    wire = Wire()
    keeping = Keeping(wire, members, None)
    ages, none = Ages(np.ones(1), False, 0.0), SimpleNamespace(under_way=set())
    telling = Telling(wire, wire, members, keeping, ages, load_causes(), none)
    for first in range(0, len(run['stamp']), PIECE):
        piece = slice(first, first + PIECE)
        stamp = run['stamp'][piece]
        rows = Rows(
            np.zeros(len(stamp), np.int64), stamp, {name: run[name][piece] for name in SIGNALS}
        )
        telling.tell(telling.judge(rows).happened)
        telling.beat(np.zeros(1))
    events = [one.event for one in wire.sent[FleetEvent]]
    assert {one.valve for one in wire.sent[FleetEvent]} == {'/lv1'}
    raised, *later = events
    assert raised.transition == FaultEvent.RAISED
    assert 'control-room test r1/' in raised.text
    named = [event for event in later if event.cause][-1]
    assert (named.transition, named.cause, named.occurrence) == (FaultEvent.CHANGED, 'f11', 1)
    assert 'f11 servomotor spring' in named.text
    assert '% of the stroke too far closed' in named.text
    assert 0.5 < named.confidence <= 1.0
    onset = named.onset.sec * SECOND + named.onset.nanosec
    assert onset == keeping.detector(0).decision.onset
    judged = [one.isolation for one in wire.sent[FleetIsolation]]
    assert list(judged[-1].candidate) == ['f11']
    assert {one.occurrence for one in judged} == {1}
