# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Estimator and detector in one process: joined inside, and outside as two nodes over DDS."""

import pytest
from damadics_bringup.processes import parameters
from damadics_fd.ros import qos
from damadics_fd.ros.conversions import nanoseconds, set_stamp
from damadics_msgs.msg import Estimate, FaultFlag, Float64Stamped
from driven_valve import SETTINGS, Valve
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

pytestmark = pytest.mark.ros
HEALTHY = FaultFlag.STATE_HEALTHY


def values(valve, node: str) -> dict[str, str]:
    report = valve.report(node)
    return {v.key: v.value for v in report.values} if report else {}


def test_joined_nodes_are_two_nodes_to_everybody_else(processes, peer):
    words = parameters(**SETTINGS, alarm_folder='')
    processes.start(
        'damadics_fd', 'monitors', ['estimator', *parameters(**SETTINGS), '--', 'detector', *words]
    )
    valve = Valve(peer)
    graph = peer.node
    assert peer.wait(lambda: valve.flags and graph.count_subscribers('/measurement') == 1)
    assert peer.wait(lambda: peer.publisher.get_subscription_count() == 1)

    # with nobody else listening, it judges and raises alarms
    assert valve.run_until(lambda: valve.flags[-1].state == HEALTHY)
    valve.raise_alarm()
    assert graph.count_publishers('/estimate') == 1
    assert graph.count_subscribers('/estimate') == 0  # nothing comes back through DDS

    # who subscribes gets every sample once, and the detector hears none twice
    heard = {
        'estimate': peer.listen(Estimate, 'estimate', qos.SAMPLES),
        'residual': peer.listen(Float64Stamped, 'residual', qos.SAMPLES),
        'threshold': peer.listen(Float64Stamped, 'threshold', qos.SAMPLES),
    }
    assert valve.run_until(lambda: all(heard.values()))
    valve.run(2.0)
    for topic, messages in heard.items():
        assert peer.wait(lambda m=messages: nanoseconds(m[-1].header.stamp) == valve.sent[-1])
        stamps = [nanoseconds(m.header.stamp) for m in messages]
        assert stamps == valve.sent[valve.sent.index(stamps[0]) :], topic
        assert {m.header.frame_id for m in messages} == {'LC74_20'}
    assert valve.run_until(
        lambda: int(values(valve, 'detector').get('Estimates judged', 0)) >= len(heard['residual'])
    )
    assert values(valve, 'detector')['Estimates received twice'] == '0'

    # another estimator of the same valve is told, and what it sends is judged
    other = graph.create_publisher(Estimate, 'estimate', qos.SAMPLES)
    assert peer.wait(lambda: other.get_subscription_count() == 2)  # the detector and this test
    peer.wait(lambda: False, 0.3)
    other.publish(heard['estimate'][-1])
    assert valve.run_until(lambda: values(valve, 'detector')['Estimates received twice'] == '1')
    assert valve.run_until(lambda: values(valve, 'detector')['Publishers'] == '2')
    valve.run(
        2.0
    )  # what the estimator beside it publishes comes to the detector too, and is known
    assert values(valve, 'detector')['Estimates received twice'] == '1'
    graph.destroy_publisher(other)
    assert valve.run_until(lambda: graph.count_subscribers('/estimate') == 1)  # this test

    # an estimator outside is listened to where the one beside it is inactive
    taken = Transition(id=Transition.TRANSITION_DEACTIVATE)
    assert valve.call(ChangeState, 'estimator/change_state', transition=taken).success
    other = graph.create_publisher(Estimate, 'estimate', qos.SAMPLES)
    assert peer.wait(lambda: other.get_subscription_count() == 2)
    told = len(valve.told('detector'))
    assert peer.wait(lambda: len(valve.told('detector')) > told + 1)  # one made before may be late
    judged = int(values(valve, 'detector')['Estimates judged'])
    message = heard['estimate'][-1]
    for n in range(1, 21):
        set_stamp(message.header.stamp, valve.sent[-1] + n * 1_000_000)
        other.publish(message)
    assert peer.wait(lambda: int(values(valve, 'detector')['Estimates judged']) == judged + 20)
    graph.destroy_publisher(other)
    taken = Transition(id=Transition.TRANSITION_ACTIVATE)
    assert valve.call(ChangeState, 'estimator/change_state', transition=taken).success

    # a detector that is inactive judges nothing, and goes on where it is told to
    valve.calm()
    for step, state in (
        (Transition.TRANSITION_DEACTIVATE, FaultFlag.STATE_NOT_MONITORING),
        (Transition.TRANSITION_CLEANUP, None),
        (Transition.TRANSITION_CONFIGURE, FaultFlag.STATE_NOT_MONITORING),
        (Transition.TRANSITION_ACTIVATE, HEALTHY),
    ):
        done = valve.call(ChangeState, 'detector/change_state', transition=Transition(id=step))
        assert done.success
        if state is None:
            heard['estimate'].clear()  # the estimator is then on its own
            assert valve.run_until(lambda: len(heard['estimate']) > 10)
        else:
            assert valve.run_until(lambda state=state: valve.flags[-1].state == state)
    processes.end('monitors')
    assert 'internal error' not in processes.log('monitors').read_text()
