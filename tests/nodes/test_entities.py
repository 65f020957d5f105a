# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""An error in a callback ends neither the node nor its process, and is told."""

import time
from types import SimpleNamespace

import pytest
import rclpy
from conftest import PATIENCE
from damadics_fd.nodes import input_watch
from damadics_fd.ros.diagnostics import Diagnostics, Level
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.process import own_services, status_board
from damadics_fd.ros.process.rounds import Rounds
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode
from rclpy.qos import QoSProfile
from std_msgs.msg import Int32
from std_srvs.srv import Trigger

pytestmark = pytest.mark.ros
PROFILE = QoSProfile(depth=100)


@pytest.fixture
def node(domain):
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = LifecycleNode('contained', context=context)
    own_services.contain(node)
    executor = EventsExecutor(context=context)
    executor.add_node(node)

    def wait(condition, patience=PATIENCE):
        deadline = time.monotonic() + patience
        while not condition() and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.05)
        return condition()

    node.wait = wait
    yield node
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


def test_nodes_of_a_process_share_one_timer_and_go_on_without_each_other(node):
    rounds, calls = Rounds(), []
    one, other = Entities(node, rounds), Entities(node, rounds)

    def fails():
        calls.append('one')
        raise ValueError('not now')

    one.every(0.01, fails)
    other.every(0.01, lambda: calls.append('other'))
    assert len(list(node.timers)) == 1
    assert node.wait(lambda: calls.count('other') >= 2)
    assert one.problem and not other.problem
    one.release()  # whose timer it was
    calls.clear()
    assert node.wait(lambda: calls.count('other') >= 2)
    assert 'one' not in calls
    other.release()
    assert not list(node.timers)


def test_nodes_of_a_process_tell_their_health_in_one_message(node, monkeypatch):
    monkeypatch.setattr(status_board, 'PERIOD', 0.02)
    rounds, heard = Rounds(), []
    node.create_subscription(DiagnosticArray, '/diagnostics', heard.append, 100)

    def fails():
        raise ValueError('not now')

    members = [Entities(node, rounds) for _ in range(3)]
    reports = [lambda: (Level.OK, 'well', {}), fails, lambda: (Level.WARN, 'not so well', {})]
    told = [
        Diagnostics(node, entities, f'LV-{n}', report)
        for n, (entities, report) in enumerate(zip(members, reports, strict=True))
    ]

    def last():
        return [status.message for status in heard[-1].status] if heard else None

    assert node.wait(lambda: last() == ['well', 'not so well'])
    assert members[1].problem and not members[0].problem
    assert len(list(node.publishers)) == len({p.topic_name for p in node.publishers})
    told[2].publish()  # at once, alone
    assert node.wait(lambda: ['not so well'] in [[s.message for s in m.status] for m in heard])
    members[0].release()  # whose publisher it was
    heard.clear()
    assert node.wait(lambda: last() == ['not so well'])


def test_a_timer_that_fails_goes_on_and_is_told(node):
    entities, calls = Entities(node), []

    def act():
        calls.append(1)
        if len(calls) < 3:
            raise ValueError('not now')

    entities.timer(0.01, act)
    assert node.wait(lambda: entities.problem)
    assert 'ValueError: not now (act, line' in entities.problem
    assert node.wait(lambda: len(calls) >= 4)
    assert entities.problem == ''
    entities.release()


def test_a_subscription_that_fails_takes_the_next_message(node):
    entities, got = Entities(node), []

    def take(message):
        if message.data == 1:
            raise KeyError('x')
        got.append(message.data)

    publisher = entities.publisher(Int32, 'number', PROFILE)
    entities.subscription(Int32, 'number', take, PROFILE)
    publisher.publish(Int32(data=1))
    assert node.wait(lambda: entities.fails('number'))
    publisher.publish(Int32(data=2))
    assert node.wait(lambda: got == [2])
    assert not entities.fails('number')
    entities.release()


def test_a_service_that_fails_answers_without_success(node):
    entities = Entities(node)

    def serve(request, response):
        response.message = 'half done'
        raise RuntimeError('broken')

    entities.service(Trigger, 'broken', serve)
    client = node.create_client(Trigger, 'broken')
    assert node.wait(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    assert node.wait(future.done)
    assert not future.result().success
    assert 'broken' in entities.problem
    entities.release()


def test_what_is_queued_for_a_released_entity_does_nothing(node):
    entities, calls = Entities(node), []
    timer = entities.timer(0.001, lambda: calls.append(timer.timer_period_ns))
    publisher = entities.publisher(Int32, 'number', PROFILE)
    entities.subscription(Int32, 'number', lambda m: entities.release(), PROFILE)
    for n in range(50):
        publisher.publish(Int32(data=n))
    assert node.wait(lambda: not entities._alive)
    before = len(calls)
    node.wait(lambda: False, 0.5)
    assert len(calls) == before
    assert entities.problem == ''
    assert 'number' not in dict(node.get_topic_names_and_types())


@pytest.mark.parametrize('number', [3, 4, 200, 255])
def test_a_transition_that_does_not_fit_is_answered_and_changes_nothing(node, number):
    client = node.create_client(ChangeState, 'contained/change_state')
    assert node.wait(client.service_is_ready)
    future = client.call_async(ChangeState.Request(transition=Transition(id=number)))
    assert node.wait(future.done), 'no answer'
    assert not future.result().success
    future = client.call_async(ChangeState.Request(transition=Transition(id=1)))
    assert node.wait(future.done)
    assert future.result().success, 'the life cycle is out of step'


def test_an_input_that_is_silent_is_asked_for_once_not_at_every_look(node, monkeypatch):
    monkeypatch.setattr(input_watch, 'FIRST_WORD', 0.05)
    said, turns = [], []
    log = SimpleNamespace(warning=said.append)
    monkeypatch.setattr(node, 'get_logger', lambda: log)
    entities = Entities(node)
    watch = input_watch.InputWatch(node, entities, 'measurement', 'start the driver', 1.0)
    entities.timer(0.05, lambda: turns.append(1))  # as often as it would be asked for
    assert watch.silent
    assert node.wait(lambda: said and len(turns) >= 10)
    assert said == ['waiting for /measurement: start the driver']
    entities.release()
