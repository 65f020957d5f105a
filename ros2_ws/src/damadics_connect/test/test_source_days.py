# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A day of source time, as files and brokers bring it: daylight saving, clocks that are set."""

import asyncio
import json
import math
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from zoneinfo import ZoneInfo

import numpy as np
import pytest

pytest.importorskip('aiomqtt')
from aiomqtt import Message
from damadics_connect.files.source import Files, Stamps
from damadics_connect.mqtt import devices, incoming
from damadics_connect.mqtt.incoming import Incoming
from damadics_connect.mqtt.sparkplug import write_payload
from damadics_connect.valve_list import Signal, ValveSource
from damadics_fd.bag.mapping import Scale

NANO = 10**9
WARSAW = ZoneInfo('Europe/Warsaw')
SIGNALS = (Signal(0, 'SP', Scale()), Signal(1, 'POS', Scale()))
SPRING = datetime(2026, 3, 28, 23, 0, tzinfo=UTC)  # local midnight; the hour from 2 is left out
AUTUMN = datetime(2026, 10, 24, 22, 0, tzinfo=UTC)  # the hour from 2 comes twice
PERIOD = 10  # s
STEPS = {30_000: 7.0, 40_000: -7.0, 50_000: 400.0, 60_000: -400.0, 70_000: 0.4, 75_000: -0.4}


class Kept:
    """An output that keeps what it gets."""

    samples = 0
    zero: frozenset[str] = frozenset()

    def __init__(self):
        self.rows = []

    def send(self, valve, stamp, values):
        self.rows.append((stamp, values[:2]))

    def flush(self):
        """Keep it."""


def instants(begin, hours, steps):
    """Yield second and source time of each sample of a day, by a clock that is set at times."""
    offset = 0.0
    for t in range(0, hours * 3600, PERIOD):
        offset += steps.get(t, 0.0)
        yield t, begin + timedelta(seconds=t + offset)


def ns(when):
    return round(when.timestamp() * 1e6) * 1000


def judged(kept, wanted, steps):
    """Check that what was sent are the samples with their own values, but for a few at steps."""
    back = sum(step < 0.0 for step in steps.values())
    by_time = dict(kept.rows)
    wrong = [t for t, stamp in wanted if by_time.get(stamp, [math.nan] * 2)[1] != t]
    assert len(wrong) <= 2 * back + sum(abs(s) for s in steps.values()) / PERIOD, wrong[:20]
    if not steps:
        assert wrong == [] and len(kept.rows) == len(wanted)
        assert set(np.diff([stamp for stamp, _ in kept.rows])) == {PERIOD * NANO}


@pytest.mark.parametrize('steps', [{}, STEPS], ids=['even', 'set'])
@pytest.mark.parametrize(
    ('begin', 'hours'), [(SPRING, 23), (AUTUMN, 25)], ids=['spring', 'autumn']
)
def test_a_historian_that_writes_local_times_without_a_zone(tmp_path, begin, hours, steps):
    path = tmp_path / 'lv1.csv'
    wanted, lines = [], ['Time,SP,POS']
    for t, when in instants(begin, hours, steps):
        local = when.astimezone(WARSAW).replace(tzinfo=None)
        lines.append(f'{local.isoformat(sep=" ")},0.5,{t}')
        wanted.append((t, ns(when)))
    path.write_text('\n'.join(lines) + '\n')
    kept = Kept()
    valve = ValveSource('lv1', 'LV-1', float(PERIOD), SIGNALS, str(path))
    stamps = lambda: Stamps('Time', 'iso', WARSAW)  # noqa: E731
    files = Files([valve], tmp_path, False, stamps, kept, print)
    for row in files._followed[path].rows():
        files._take(path, row)
    judged(kept, wanted, steps)


@pytest.mark.parametrize('steps', [{}, STEPS], ids=['even', 'set'])
@pytest.mark.parametrize(
    ('begin', 'hours'), [(SPRING, 23), (AUTUMN, 25)], ids=['spring', 'autumn']
)
@pytest.mark.parametrize('kind', ['json', 'sparkplug'])
def test_a_publisher_by_local_time_and_a_device(monkeypatch, kind, begin, hours, steps):
    clock = SimpleNamespace(now=0)
    times = SimpleNamespace(monotonic_ns=lambda: clock.now, time_ns=lambda: 0, monotonic=lambda: 0)
    monkeypatch.setattr(incoming, 'time', times)
    monkeypatch.setattr(devices, 'time', times)
    topic = 'plant/lv1' if kind == 'json' else 'spBv1.0/G/N/D'
    kept, wanted = Kept(), []
    valve = ValveSource('lv1', 'LV-1', float(PERIOD), SIGNALS, topic)
    follower = Incoming(SimpleNamespace(shown='b'), [valve], ('t', 'iso'), kept, print)

    def message(t, when):
        if kind == 'json':
            told = {'t': when.astimezone(WARSAW).isoformat(), 'SP': 0.5, 'POS': float(t)}
            return Message(topic, json.dumps(told).encode(), 1, False, 1, None)
        payload = write_payload({'SP': 0.5, 'POS': float(t)}, ns(when) // 10**6, t // PERIOD % 256)
        what = 'DDATA' if t else 'DBIRTH'
        return Message(f'spBv1.0/G/{what}/N/D', payload, 0, False, 1, None)

    class Client:
        """A connection whose messages come at their time."""

        async def publish(self, *given, **more):
            """Ask for a birth in vain."""

        @property
        def messages(self):
            async def each():
                for t, when in instants(begin, hours, steps):
                    clock.now = (1000 + t) * NANO
                    wanted.append((t, ns(when)))
                    yield message(t, when)

            return each()

    asyncio.run(follower._take(Client()))
    judged(kept, wanted, steps)


def test_rows_a_little_out_of_order_are_not_taken_for_the_second_hour():
    """Two writers share a file: their rows cross by a second or two."""
    stamps = Stamps('t', 'iso', WARSAW)
    texts = ['02:30:05', '02:30:04', '02:30:06', '02:59:59', '02:00:00', '02:30:02', '02:30:01']
    texts += ['02:20:00']  # a clock that was set back within it
    got = [stamps.of({'t': f'2026-10-25 {text}'}) // NANO for text in texts]
    assert np.diff(got).tolist() == [-1, 2, 1793, 1, 1802, -1, -601]


def test_who_begins_within_the_hour_that_comes_twice_knows_which_it_is(monkeypatch):
    """A connector that is restarted then follows a file that is being written."""
    from damadics_connect.files import source

    first = ns(datetime(2026, 10, 25, 0, 30, tzinfo=UTC))
    for later, wanted in ((2 * NANO, first), (3602 * NANO, first + 3600 * NANO)):
        monkeypatch.setattr(source.time, 'time_ns', lambda later=later: first + later)
        assert Stamps('t', 'iso', WARSAW).of({'t': '2026-10-25 02:30:00'}) == wanted
    monkeypatch.setattr(source.time, 'time_ns', lambda: first + 86_400 * NANO)
    assert Stamps('t', 'iso', WARSAW).of({'t': '2026-10-25 02:30:00'}) == first
