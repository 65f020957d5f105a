# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the service for partial strokes refuses, and when strokes end; without a middleware."""

from types import SimpleNamespace

import pytest
from damadics_fd.core.approximator.state import Estimate
from damadics_fd.nodes.partial_strokes import PartialStrokes, StrokeLimits
from damadics_msgs.srv import PartialStroke


class Bench:
    """The strokes of one valve, with what they ask of the driver and what they tell."""

    def __init__(self, allowed=True, drivers=1):
        self.sent, self.told, self.undo = [], [], []
        self.alarm = SimpleNamespace(active=False, latched=False)
        self.core = core = SimpleNamespace(state=[self.alarm])
        self.blind = False
        publisher = SimpleNamespace(
            publish=lambda m: self.sent.append((m.request, m.amplitude, m.count)),
            get_subscription_count=lambda: drivers,
        )
        entities = SimpleNamespace(
            publisher=lambda *_: publisher,
            service=lambda *_: None,
            on_release=self.undo.append,
        )
        actions = SimpleNamespace(tell=lambda _, done, text, **more: self.told.append(text))
        self.strokes = PartialStrokes(
            entities,
            actions,
            core,
            StrokeLimits(allowed),
            lambda: self.blind,
            lambda: hasattr(core, 'estimate'),
        )

    def see(self, x1=0.5, at=0.0):
        values = dict.fromkeys(Estimate.names(), 0.0)
        self.core.estimate = Estimate(**{**values, 'stamp': int(at * 1e9), 'x1': x1})
        self.strokes.follow(self.core.estimate, 'LV-1')

    def ask(self, amplitude=0.05, count=2):
        request = PartialStroke.Request(amplitude=amplitude, count=count, user='Anna')
        return self.strokes._serve(request, PartialStroke.Response())


@pytest.mark.parametrize(
    'request_, change, cause',
    [
        ({}, {'allowed': False}, 'allow_partial_stroke'),
        ({}, {'drivers': 0}, 'no driver'),
        ({}, {'blind': True}, 'not seen'),
        ({}, {'latched': True}, 'an alarm stands'),
        ({}, {'x1': 0.97}, 'the stem is at 0.97'),
        ({'amplitude': 0.11}, {}, 'partial_stroke_limit'),
        ({'amplitude': -0.05}, {}, 'amplitude'),
        ({'amplitude': float('nan')}, {}, 'amplitude'),
        ({'count': 21}, {}, 'count'),
        ({'count': 0}, {}, 'no partial strokes to end'),
    ],
)
def test_a_request_is_refused_with_the_reason(request_, change, cause):
    bench = Bench(change.get('allowed', True), change.get('drivers', 1))
    bench.see(change.get('x1', 0.5))
    bench.blind, bench.alarm.latched = change.get('blind', False), change.get('latched', False)
    answer = bench.ask(**request_)
    assert not answer.success and cause in answer.message
    assert bench.sent == [] and bench.told == [answer.message]


def test_before_any_measurement_nothing_is_asked_for():
    bench = Bench()
    assert 'not seen' in bench.ask().message and bench.sent == []


def test_strokes_are_counted_and_asked_for_one_at_a_time():
    bench = Bench()
    bench.see()
    assert bench.ask(count=2).success and bench.sent == [(1, 0.05, 2)]
    assert 'going on' in bench.ask().message
    for at, x1 in enumerate((0.54, 0.5, 0.46, 0.5, 0.54, 0.53, 0.46)):
        assert 'were made' not in bench.told[-1]
        bench.see(x1, at)
    assert bench.told[-1] == '2 partial strokes were made' and len(bench.sent) == 1
    assert bench.ask().success and bench.sent[-1] == (2, 0.05, 2)


@pytest.mark.parametrize('cause', ['unseen', 'alarm', 'late', 'person', 'stop'])
def test_strokes_end_when(cause):
    bench = Bench()
    bench.see()
    assert bench.ask().success
    if cause == 'unseen':
        bench.strokes.end('the valve is not seen any more')
    elif cause == 'alarm':
        bench.alarm.active = True
        bench.see(at=1.0)
    elif cause == 'late':
        bench.see(at=61.0)
    elif cause == 'person':
        assert bench.ask(count=0).success
    else:
        bench.undo[-1]()
    assert bench.sent[-1] == (1, 0.0, 0)
    assert bench.ask(count=0).message == 'there are no partial strokes to end'


def test_the_diagnostics_say_whether_strokes_may_be_asked_for():
    assert Bench(allowed=False).strokes.values == {'Partial strokes': 'not allowed'}
    bench = Bench()
    assert bench.strokes.values == {'Partial strokes': 'allowed', 'Partial stroke limit (%)': '10'}
    bench.see()
    assert bench.ask().success
    assert bench.strokes.values['Partial strokes'] == 'under way'
    bench.strokes.end('the measurement is lost')
    assert bench.strokes.values['Partial strokes'] == 'allowed'
