# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page's side of ROS 2: what it takes of whom, and what its end means."""

import os
import subprocess
import sys

import pytest
from conftest import PATIENCE, PYTEST, free_port
from damadics_dashboard.live.trend_points import TrendPoints
from damadics_dashboard.live.watcher import Watcher
from damadics_dashboard.store.history import History
from damadics_fd.ros import qos
from damadics_fd.store.intervals import Intervals
from damadics_msgs.msg import FaultFlag, Float64Stamped

pytestmark = pytest.mark.ros
FAILING = """
import sys
from damadics_dashboard.dashboard import main
from damadics_dashboard.live import watcher

def fails(name):
    raise RuntimeError('no graph')

watcher.Node = fails
sys.exit(main(sys.argv[1:]))
"""


def test_a_page_whose_ros_side_has_ended_ends_so_that_it_is_started_again(domain, tmp_path):
    words = ['--port', str(free_port()), '--state', str(tmp_path)]
    done = subprocess.run(
        [sys.executable, '-c', FAILING, *words],
        env={name: value for name, value in os.environ.items() if name != PYTEST},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode == 1, done.stderr
    assert "ROS 2 side failed: RuntimeError('no graph')" in done.stderr


def test_samples_of_a_large_fleet_are_taken_of_opened_valves_only(peer, tmp_path):
    valves = ('lv1', 'lv2')
    node = peer.node
    flags = [node.create_publisher(FaultFlag, f'/{v}/fault_flag', qos.FLAG) for v in valves]
    limits = [
        node.create_publisher(Float64Stamped, f'/{v}/threshold', qos.SAMPLES) for v in valves
    ]
    trends = TrendPoints(Intervals(tmp_path / 'trends.sqlite'))
    watcher = Watcher(History(tmp_path / 'history.sqlite'), trends, follow=1)
    watcher.start()
    try:
        assert peer.wait(lambda: all(p.get_subscription_count() for p in flags))
        watcher.want('lv1')
        assert peer.wait(lambda: limits[0].get_subscription_count() == 1)
        assert limits[1].get_subscription_count() == 0, 'nobody looks at it'
    finally:
        watcher.stop()
