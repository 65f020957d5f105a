# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the page keeps of every valve for months: out of signatures and positions."""

import time

import numpy as np
import pytest
from damadics_dashboard.live.motion import Motion
from damadics_dashboard.live.trend_points import TrendPoints
from damadics_dashboard.live.valve import Valve
from damadics_dashboard.words.outlook import outlook_words
from damadics_dashboard.words.texts import texts
from damadics_fd.store.intervals import DAY, Intervals
from damadics_fd.store.trends import TrendFile
from damadics_msgs.msg import FaultFlag, Signature


def test_motion_counts_travel_reversals_and_full_strokes_and_no_noise():
    seconds = np.arange(0.0, 400.0, 0.01)
    stroke = 0.5 - 0.5 * np.cos(2.0 * np.pi * seconds / 100.0)  # 0..1 and back in 100 s
    noise = 0.001 * np.random.default_rng(0).standard_normal(len(seconds))
    motion = Motion()
    motion.take(seconds, stroke + noise)
    assert motion.travel == pytest.approx(8.0, rel=0.03)
    assert motion.reversals == 7 and motion.cycles == 4
    still = Motion()
    still.take(seconds, 0.5 + noise)
    assert still.travel < 0.02 and still.reversals <= 2


def test_a_quarter_of_an_hour_becomes_one_point(tmp_path, monkeypatch):
    points = TrendPoints(Intervals(tmp_path / 'trends.sqlite'))
    valve = Valve('lv101')
    began = points._began * 900.0
    for friction in (0.1, 0.5, 0.3):
        valve.signature = Signature(state=Signature.STATE_MONITOR, stick_ratio=1.1, fill=0.9)
        valve.signature.change = [0.0, 1.0, friction]
        valve.signature.change_std = [0.001, 1.0, 0.02]
        points.take(valve)
    points.keep(0.0)
    assert points.intervals.valves() == [], 'the quarter of an hour is not over'
    monkeypatch.setattr(time, 'time', lambda: began + 901.0)
    points.keep(0.0)
    found = points.intervals.series('lv101', 'friction', began, began + 900.0)
    assert (found.least[0], found.mean[0], found.greatest[0]) == pytest.approx((0.1, 0.3, 0.5))
    assert points.intervals.series('lv101', 'play', began, began + 900.0).mean[0] == (
        pytest.approx(1.1)
    )
    points.close()


def test_what_the_detector_kept_without_a_page_is_taken_over_once(tmp_path):
    """A file of version 0.1, without checksums, and the points of today behind it."""
    folder = tmp_path / 'signatures' / 'unit__lv101'
    folder.mkdir(parents=True)
    began = 1_700_000_000 // 900 * 900
    old = ['stamp_ns,spring,spring_std,preload,preload_std,friction,friction_std,reference']
    old += [f'{(began + 900 * k) * 10**9},0.1,0.01,2,1,{0.1 * k:g},0.02,abc' for k in range(3)]
    old += ['cut', f'{10**9},0.1,0.01,2,1,0.9,0.02,abc']  # the last is of a simulation
    file = folder / 'LV-101.trend.csv'
    file.write_text('\n'.join(old) + '\n')
    valve = Valve('unit/lv101')
    for turn in range(3):
        points = TrendPoints(Intervals(tmp_path / 'trends.sqlite'), [folder.parent])
        points.take(valve)
        flag = FaultFlag()
        flag.header.frame_id = 'LV-101'
        valve.take_flag(flag, 0.0)
        points.take(valve)
        points.take(valve)
        found = points.intervals.series('unit/lv101', 'friction', began, began + 1e6)
        assert found.mean == pytest.approx([0.0, 0.1, 0.2, 0.7][: 3 + (turn > 0)])
        assert found.std[0] == pytest.approx(0.02)
        points.close()
        TrendFile(folder, 'LV-101', 'abc').add(
            (began + 3600) * 10**9, (0.1, 2.0, 0.7), (0.01, 1.0, 0.02)
        )


def test_a_signature_that_is_still_learned_is_no_trend(tmp_path, monkeypatch):
    points = TrendPoints(Intervals(tmp_path / 'trends.sqlite'))
    valve = Valve('lv101')
    valve.signature = Signature(state=Signature.STATE_LEARN, change=[1.0, 1.0, 1.0])
    points.take(valve)
    points.keep(0.0, force=True)
    assert points.intervals.valves() == [] or not len(
        points.intervals.series('lv101', 'friction', 0.0, 1e12).start
    )
    points.close()


def test_the_outlook_is_said_in_a_sentence(tmp_path):
    store = Intervals(tmp_path / 'trends.sqlite')
    for day in range(100):
        store.add('v', day * DAY, {'friction': 0.02 * day}, {'friction': 0.02})
    found = store.series('v', 'friction', 0.0, 100 * DAY)
    said = outlook_words('friction', found, (-0.5, 3.0), 99 * DAY, texts('en'))
    assert said.startswith('Friction, change: +198 %. Limit +300 % in about 5')
    assert 'days' in said
    calm = outlook_words('friction', found, (-0.5,), 99 * DAY, texts('de'))
    assert calm.endswith('Keine Bewegung auf eine Grenze zu.')
    slow = Intervals(tmp_path / 'slow.sqlite')
    for day in range(100):
        slow.add('v', day * DAY, {'preload': 3.0 - 1e-4 * day}, {'preload': 1e-3})
    found = slow.series('v', 'preload', 0.0, 100 * DAY)
    said = outlook_words('preload', found, (-150.0,), 99 * DAY, texts('en'))
    assert said.endswith('It does not move towards a limit.'), 'in 4000 years'
    slow.close()
    store.close()
