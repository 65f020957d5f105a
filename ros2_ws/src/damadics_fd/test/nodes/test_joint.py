# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What DDS brings again of an estimate that was handed over is told from what is foreign."""

import pytest

pytest.importorskip('damadics_msgs.msg')
from damadics_fd.core.approximator.state import Estimate as CoreEstimate
from damadics_fd.nodes import joint
from damadics_fd.nodes.joint import Joints, Taker
from damadics_fd.ros.raw import (
    Encoder,
    EstimateEncoder,
    SampleReader,
    any_estimate,
    any_sample,
    stamp_of,
    tagged_sample,
)
from damadics_msgs.msg import Estimate, Float64Stamped, Measurement
from rclpy.serialization import deserialize_message, serialize_message


def test_an_echo_is_known_once():
    taker = Taker(lambda estimate, tag: None)
    taker.sent(1)  # it does not subscribe: nothing of this comes again
    assert not taker.is_echo(1)
    taker.listen(True)
    for stamp in (1, 2, 3):
        taker.sent(stamp)
    assert taker.is_echo(1)
    assert not taker.is_echo(1)
    assert taker.is_echo(3)
    assert not taker.is_echo(2)  # 2 was lost on the way: what has its stamp now is another's
    assert not taker.is_echo(None)
    taker.sent(4)
    taker.listen(False)
    taker.listen(True)
    assert not taker.is_echo(4)


class Graph:
    """A topic with some publishers, and whether the detector subscribes to it."""

    def __init__(self, monkeypatch) -> None:
        self.publishers, self.subscribed, self.now = 0, False, 1000.0
        monkeypatch.setattr(joint.time, 'monotonic', lambda: self.now)

    def subscribe(self):
        assert not self.subscribed
        self.subscribed = True
        return self.end

    def end(self) -> None:
        assert self.subscribed
        self.subscribed = False


def test_a_detector_subscribes_while_somebody_outside_sends(monkeypatch):
    graph, both = Graph(monkeypatch), joint.Joint()
    taker = Taker(lambda estimate, tag: None)
    both.join(taker)
    leave, graph.publishers = both.enter(), 1
    outside = joint.Outside(both, taker, graph, graph.subscribe)
    outside.look()
    assert not graph.subscribed
    assert not taker.subscribed
    assert not both.heard(0)
    assert both.heard(1)

    graph.publishers = 2
    outside.look()
    outside.look()
    assert graph.subscribed
    assert taker.subscribed
    assert not both.heard(1)  # that is the detector itself
    assert both.heard(2)

    graph.publishers = 1
    for later, subscribed in ((0.5 * joint.LINGERING, True), (joint.LINGERING, False)):
        graph.now += later
        outside.look()
        assert graph.subscribed == taker.subscribed == subscribed

    leave()  # no estimator is left in the process: one may come anywhere
    graph.publishers = 0
    outside.look()
    assert graph.subscribed


def test_a_detector_without_an_estimator_beside_it_subscribes_at_once(monkeypatch):
    graph, alone = Graph(monkeypatch), joint.Joint()
    taker = Taker(lambda estimate, tag: None)
    joint.Outside(alone, taker, graph, graph.subscribe).look()
    assert graph.subscribed
    assert taker.subscribed


def test_a_joint_is_of_one_topic():
    joints = Joints()
    handed = []
    joints.at('/a/estimate').takers.append(Taker(lambda *given: handed.append(given)))
    joints.at('/b/estimate').hand('of b', 'B')
    joints.at('/a/estimate').hand('of a', 'A')
    assert handed == [('of a', 'A')]


@pytest.mark.parametrize('tag', ['', 'LV-101', 'Ventil für Öl'])
def test_stamp_and_tag_are_read_from_bytes(tag):
    message = Measurement(cv=0.1, x1=0.2)
    message.header.frame_id = tag
    message.header.stamp.sec, message.header.stamp.nanosec = 3, 4
    data = serialize_message(message)
    assert tagged_sample(data) == any_sample(data)
    assert tagged_sample(data)[1] == tag
    estimate = Estimate(header=message.header)
    assert stamp_of(serialize_message(estimate)) == 3_000_000_004
    assert stamp_of(b'\0\1\0\0\1') is None


def test_samples_are_read_alike_whatever_came_before():
    read = SampleReader()
    for number, tag in enumerate(['LV-1', 'LV-1', 'LV-2', '', '', 'Ventil für Öl', 'LV-1']):
        message = Measurement(cv=0.1, x1=0.2 * number, ps=-1.0)
        message.header.frame_id = tag
        message.header.stamp.sec, message.header.stamp.nanosec = -3, number
        data = serialize_message(message)
        assert read(data) == any_sample(data)
        assert read(data) == any_sample(data)
        turned = b'\0\0' + data[2:4] + bytes(len(data))  # big-endian, all zero
        assert read(turned) == any_sample(turned)
        for cut in (data[:-1], data[:20], data[:3]):
            with pytest.raises((ValueError, RuntimeError)):
                read(cut)


@pytest.mark.parametrize('tag', ['', 'LV', 'LV-101', 'Ventil für Öl'])
def test_encoded_messages_are_those_of_the_middleware(tag):
    values = [0.1 * n for n in range(14)]
    estimate = CoreEstimate(3_000_000_004, *values, 4)
    data = EstimateEncoder().encode(estimate, tag)
    message = deserialize_message(data, Estimate)
    assert message.header.frame_id == tag
    assert message.alpha_hat.tolist() == values[6:9]
    assert (message.x2, message.progress, message.phase) == (0.0, values[13], 4)
    assert any_estimate(data) == any_estimate(serialize_message(message)) == (estimate, tag)
    assert len(data) == len(serialize_message(message))  # padding is not set by the middleware
    number = Float64Stamped(header=message.header, data=0.7)
    data = Encoder()(3_000_000_004, tag, 0.7)
    assert deserialize_message(data, Float64Stamped) == number
    assert len(data) == len(serialize_message(number))


def test_an_encoder_follows_the_tag_and_a_cut_estimate_is_refused():
    encoder = EstimateEncoder()
    for tag in ('A', 'longer', 'A'):
        estimate = CoreEstimate(-1, *[float('nan')] * 14, 255)
        data = encoder.encode(estimate, tag)
        assert any_estimate(data)[1] == tag
        assert any_estimate(data)[0].stamp == -1
        with pytest.raises(ValueError, match='cut off'):
            any_estimate(data[:-1])
