# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What was published before the end is taken, on a machine that is busy too."""

import time

import pytest
from damadics_fd.ros.spin import take_what_is_on_its_way

MS = 1_000_000


class Executor:
    """
    Subscribers whose messages come in a given order.

    :param slices: for each spin: messages that come in it, their age in ms at the start, and how
        many times as long as it should the spin takes.
    """

    def __init__(self, *slices: tuple[int, float, float]) -> None:
        self.slices = list(slices)
        self.began = time.time_ns()
        self.received = 0
        self.newest = 0

    def spin_until_future_complete(self, future, patience):
        count, age, times = self.slices.pop(0) if self.slices else (0, 0.0, 1.0)
        time.sleep(patience * times)
        self.received += count
        if count:
            self.newest = int(self.began - age * MS)

    def take(self) -> None:
        take_what_is_on_its_way(self, lambda: self.received, lambda: self.newest)


@pytest.mark.parametrize(
    'slices',
    [
        pytest.param([(0, 0, 3)] * 5 + [(178, 100, 1)], id='held up, then all at once'),
        pytest.param([(0, 0, 1), (0, 0, 1), (178, 100, 1)], id='late'),
        pytest.param([(1, -5000, 1), (177, 100, 1)], id='a clock that is ahead'),
        pytest.param([(1, 400 - 10 * k, 1) for k in range(30)] + [(148, 100, 1)], id='far behind'),
    ],
)
def test_messages_of_before_are_waited_for(slices):
    executor = Executor(*slices)
    executor.take()
    assert executor.received >= 178


def test_a_stream_that_goes_on_is_left():
    executor = Executor(*[(20, -20 * k, 1) for k in range(-1, 500)])
    executor.take()
    assert 20 < executor.received < 500


def test_silence_is_not_waited_for():
    executor = Executor(*[(0, 0, 1)] * 100)
    executor.take()
    assert executor.slices
