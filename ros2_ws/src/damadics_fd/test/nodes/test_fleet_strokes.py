# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Valves of a fleet that allow partial strokes are followed while they make some."""

from types import SimpleNamespace

import numpy as np
import pytest
from damadics_fd.causes import load_causes
from damadics_fd.core.sample import SIGNALS

pytest.importorskip('damadics_msgs.msg')
from damadics_fd.nodes.fleet.ages import Ages
from damadics_fd.nodes.fleet.blocks import Rows
from damadics_fd.nodes.fleet.keeping import Keeping, Operated
from damadics_fd.nodes.fleet.members import Members, members_of
from damadics_fd.nodes.fleet.strokes import FleetStrokes
from damadics_fd.nodes.fleet.telling import Telling
from damadics_fd.store.fleet_file import FleetError, Valve
from damadics_msgs.srv import PartialStroke

PERIOD = 10_000_000  # ns
SETTINGS = {'mode': 'monitor', 'sample_rate': 100.0}
ALLOWED = {**SETTINGS, 'allow_partial_stroke': True, 'partial_stroke_limit': 0.2}


class Bench:
    """Two valves that allow strokes and one that does not, with what is published and served."""

    def __init__(self):
        self.sent, self.told, self.services = {}, [], {}
        self.members = Members(
            members_of(
                [
                    Valve('a', settings=ALLOWED),
                    Valve('plant/b', settings={**ALLOWED, 'actuator': 'B'}),
                    Valve('c', settings=SETTINGS),
                ]
            )
        )
        keeping = Keeping(self, self.members, None)
        actions = SimpleNamespace(tell=lambda _, done, text, **more: self.told.append(text))
        self.old = set()
        operated = Operated(self, actions, self.members, keeping)
        self.strokes = FleetStrokes(operated, lambda number: number in self.old)
        ages = Ages(np.ones(3), False, 0.0)
        causes = load_causes()
        self.telling = Telling(self, self, self.members, keeping, ages, causes, self.strokes)
        self.instant = 0

    def publisher(self, kind, topic, profile):
        mine = self.sent.setdefault(topic, [])
        return SimpleNamespace(
            publish=lambda m: mine.append((m.header.frame_id, m.amplitude, m.count)),
            get_subscription_count=lambda: 1,
        )

    def service(self, kind, name, serve):
        self.services[name] = serve

    def on_release(self, undo):
        pass

    def move(self, *positions):
        """Send a block with the samples of all valves, the stems at these places in turn."""
        n = len(positions)
        stamps = (self.instant + 1 + np.arange(n)) * PERIOD
        self.instant += n
        columns = {name: np.repeat(np.full(n, 0.5), 3) for name in SIGNALS}
        columns['x1'] = np.repeat(np.array(positions), 3)
        return self.telling.judge(Rows(np.tile(np.arange(3), n), np.repeat(stamps, 3), columns))

    def ask(self, valve, amplitude=0.1, count=2):
        request = PartialStroke.Request(amplitude=amplitude, count=count)
        return self.services[f'{valve}/partial_stroke'](request, PartialStroke.Response())


def test_only_valves_that_allow_strokes_serve_them():
    bench = Bench()
    assert list(bench.services) == ['/a/partial_stroke', '/plant/b/partial_stroke']
    assert 'not seen' in bench.ask('/a').message, 'before any sample'
    bench.move(0.5)
    assert 'partial_stroke_limit' in bench.ask('/a', amplitude=0.25).message
    bench.old.add(0)
    assert 'not seen' in bench.ask('/a').message


def test_strokes_within_one_block_are_counted_and_no_other_valve_is_touched():
    bench = Bench()
    bench.move(0.5)
    assert bench.ask('/plant/b').success
    assert bench.sent['/plant/b/stroke_request'] == [('B', 0.1, 2)]
    assert bench.sent['/a/stroke_request'] == []
    bench.move(0.58, 0.5, 0.42, 0.5, 0.58)
    assert 'going on' in bench.ask('/plant/b').message
    assert bench.strokes.values == {'Partial strokes under way': '/plant/b'}
    taken = bench.move(0.5, 0.42, 0.5)
    assert taken.refused == 0
    assert bench.told[-1] == '/plant/b: 2 partial strokes were made'
    assert bench.strokes.under_way == set() and bench.strokes.values == {}
    assert len(bench.sent['/plant/b/stroke_request']) == 1


def test_samples_that_are_followed_one_by_one_are_judged_as_the_others():
    bench = Bench()
    bench.move(0.5)
    assert bench.ask('/a').success
    for n in range(40):
        bench.move(*(0.5 + 0.06 * np.sin(0.3 * np.arange(5 * n, 5 * n + 5))))
    (bank,) = bench.members.banks
    assert bank.decisions[0].tobytes() == bank.decisions[1].tobytes()
    assert bank.estimates[0].tobytes() == bank.estimates[1].tobytes()


def test_strokes_end_when_the_valve_is_not_seen_any_more():
    bench = Bench()
    bench.move(0.5)
    assert bench.ask('/a').success and bench.strokes.under_way == {0}
    bench.strokes.look()
    assert bench.strokes.under_way == {0}
    bench.old.add(0)
    bench.strokes.look()
    assert bench.strokes.under_way == set()
    assert bench.sent['/a/stroke_request'][-1] == ('a', 0.0, 0)
    assert 'the valve is not seen any more' in bench.told[-1]


@pytest.mark.parametrize(
    'wrong',
    [
        {'allow_partial_stroke': 'yes'},
        {'partial_stroke_limit': 0.6},
        {'partial_stroke_limit': 'much'},
        {'partial_stroke_limit': float('nan')},
    ],
)
def test_what_a_list_says_of_strokes_is_checked(wrong):
    with pytest.raises(FleetError, match=f'bad: {next(iter(wrong))}'):
        members_of([Valve('bad', settings={**ALLOWED, **wrong})])
