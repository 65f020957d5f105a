# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Running nodes under attack: lost files, old samples, wild stamps, hostile text, bad requests."""

import os
import signal
import threading
import time

import pytest
import rclpy
from conftest import PATIENCE
from damadics_bringup.launcher import arguments_of
from damadics_bringup.processes import parameters
from damadics_fd.nodes import second_publisher
from damadics_fd.ros import qos
from damadics_fd.ros.conversions import nanoseconds
from damadics_fd.ros.entities import Entities
from damadics_msgs.msg import Estimate, FaultFlag, OperatorAction
from damadics_msgs.srv import Acknowledge, Reference, ResetAlarm, Shelve
from driven_valve import SETTINGS, start
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Empty as Empty

pytestmark = pytest.mark.ros
HEALTHY, UNKNOWN = FaultFlag.STATE_HEALTHY, FaultFlag.STATE_UNKNOWN
NAMES = ('estimator', 'detector')


def await_state(valve, state, patience=PATIENCE):
    assert valve.run_until(
        lambda: valve.flags and valve.flags[-1].state == state, patience=patience
    ), (valve.flags[-1:], [valve.told(node)[-1:] for node in NAMES])


def test_a_damaged_alarm_is_shown_as_lost_until_somebody_confirms(processes, peer, tmp_path):
    alarms = tmp_path / 'alarms'
    valve = start(processes, peer, str(alarms))
    valve.raise_alarm()
    files = sorted(alarms.glob('root.alarm.*.json'))
    assert len(files) == 2
    processes.end('detector')
    for file in files:
        file.write_bytes(file.read_bytes()[:-20])
    before = len(valve.flags)
    again = parameters(alarm_folder=str(alarms), **SETTINGS)
    processes.start('damadics_fd', 'detector', again)
    assert valve.run_until(lambda: len(valve.flags) > before)
    await_state(valve, UNKNOWN)
    valve.run(2.0)
    assert HEALTHY not in {flag.state for flag in valve.flags[before:]}
    assert valve.flags[-1].level == FaultFlag.NE107_FUNCTION_CHECK
    assert valve.run_until(lambda: valve.says('detector', 'the alarm of before is lost'))
    assert valve.report('detector').level == b'\x02'
    assert len(list(alarms.glob('*.bad-*'))) == 2
    processes.end('detector')  # a restart is no confirmation
    before = len(valve.flags)
    processes.start('damadics_fd', 'detector', again)
    assert valve.run_until(lambda: len(valve.flags) > before)
    await_state(valve, UNKNOWN)
    assert HEALTHY not in {flag.state for flag in valve.flags[before:]}
    assert valve.call(Acknowledge, 'acknowledge', user='Anna', comment='looked at it').success
    await_state(valve, HEALTHY)


def test_an_alarm_that_cannot_be_saved_is_told_and_saved_later(processes, peer, tmp_path):
    alarms = tmp_path / 'alarms'
    valve = start(processes, peer, str(alarms))
    valve.run(0.5)
    (alarms / 'root.alarm.a.json').mkdir()  # no file can take its place
    valve.raise_alarm()
    assert valve.run_until(lambda: valve.says('detector', 'would not survive a restart'))
    assert valve.report('detector').level == b'\x02'
    (alarms / 'root.alarm.a.json').rmdir()
    assert valve.run_until(lambda: not valve.says('detector', 'would not survive'))
    assert (alarms / 'root.alarm.a.json').is_file()


def test_folders_that_cannot_be_written_are_refused_at_the_start(processes, domain):
    for n, given in enumerate(
        ({'alarm_folder': '/dev/null/x'}, {'signature_folder': '/proc/x', 'alarm_folder': ''})
    ):
        processes.start('damadics_fd', 'detector', parameters(**SETTINGS, **given), f'd{n}')
    processes.start('damadics_fd', 'estimator', parameters(reference='/proc/x/y', **SETTINGS), 'e')
    deadline = time.monotonic() + 60.0
    labels = ('d0', 'd1', 'e')
    while not all(map(processes.ended, labels)) and time.monotonic() < deadline:
        time.sleep(0.1)
    for label in labels:
        assert processes.exit_code(label) == 1
        assert 'cannot write into' in processes.log(label).read_text()


def test_samples_that_waited_are_not_healthy(processes, peer, request):
    """B1: an estimator that stood still goes through old samples afterwards."""
    valve = start(processes, peer)
    ages = []

    def note(flag: FaultFlag, info: dict) -> None:
        """Note how old a judgement was when it was published, whenever it is heard."""
        due = valve.zero + nanoseconds(flag.header.stamp) * 1e-9
        told = info['source_timestamp'] * 1e-9 - (time.time() - time.monotonic())
        ages.append((flag.state, told - due))

    # the executor of the peer gives no times of publication
    node = rclpy.create_node('ear', context=peer.context)
    executor = SingleThreadedExecutor(context=peer.context)
    executor.add_node(node)
    node.create_subscription(FaultFlag, 'fault_flag', note, qos.FLAG)
    ear = threading.Thread(target=executor.spin)
    ear.start()
    request.addfinalizer(ear.join)
    request.addfinalizer(executor.shutdown)
    await_state(valve, HEALTHY, 90.0)
    # an age is counted from the shortest way so far: that of the start may be long
    assert valve.run_until(lambda: any(age < 0.3 for _, age in ages))
    os.kill(processes.pid('estimator'), signal.SIGSTOP)
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_NOT_MONITORING)
    valve.run(5.0)
    before = len(ages)
    os.kill(processes.pid('estimator'), signal.SIGCONT)
    await_state(valve, HEALTHY, 90.0)
    valve.run(1.0)
    assert HEALTHY in {state for state, _ in ages[before:]}
    # 2 s, and what the machine may have held up; the oldest that waited are 5 s old
    assert max(age for state, age in ages if state == HEALTHY) < 4.0


def test_dated_samples_that_are_old_are_not_healthy_and_say_why(processes, peer):
    valve = start(processes, peer)
    valve.stamp = time.time_ns() - 60 * 10**9
    valve.run(3.0)
    assert HEALTHY not in {flag.state for flag in valve.flags}
    assert valve.run_until(lambda: valve.says('detector', 's old'))
    valve.stamp = time.time_ns()
    await_state(valve, HEALTHY)


def test_one_stamp_of_2038_ends_no_shelf(processes, peer):
    valve = start(processes, peer)
    await_state(valve, HEALTHY)
    assert valve.call(Shelve, 'shelve', duration=600.0).success
    wild = peer.node.create_publisher(Estimate, 'estimate', qos.SAMPLES)
    assert peer.wait(lambda: wild.get_subscription_count() > 0)
    message = Estimate()
    message.header.stamp.sec = 2**31 - 5
    for _ in range(30):  # until the detector has met this publisher and its diagnostics say so
        wild.publish(message)
        peer.send((2**31 - 5) * 10**9, 0.5, 0.5)
        valve.run(0.3)
        values = {v.key: v.value for v in valve.report('detector').values}
        if int(values['Messages stamped far ahead']) >= 2:
            break
    else:
        pytest.fail(f'the detector has not told of stamps far ahead: {values}')
    assert valve.flags[-1].state == FaultFlag.STATE_SHELVED
    peer.node.destroy_publisher(wild)


def test_a_transition_that_does_not_fit_is_answered(processes, peer):
    valve = start(processes, peer)
    for node in NAMES:
        for given in (
            {'id': Transition.TRANSITION_ACTIVATE},
            {'id': 200},
            {'label': 'nonsense\x1b[2J\n[ERROR] forged'},
        ):
            answer = valve.call(
                ChangeState, f'{node}/change_state', transition=Transition(**given)
            )
            assert not answer.success
        assert valve.call(GetState, f'{node}/get_state').current_state.label == 'active'
        log = processes.log(node)
        assert valve.run_until(lambda log=log: 'nonsense' in log.read_text())
        assert '\x1b' not in log.read_text() and '\n[ERROR] forged' not in log.read_text()
    await_state(valve, HEALTHY)
    assert not any(map(processes.ended, NAMES))


def test_what_is_made_is_released_and_made_again(processes, peer):
    valve = start(processes, peer)
    graph = peer.node
    steps = [
        (Transition.TRANSITION_DEACTIVATE, 1),
        (Transition.TRANSITION_CLEANUP, 0),
        (Transition.TRANSITION_CONFIGURE, 1),
        (Transition.TRANSITION_ACTIVATE, 1),
    ]
    for _ in range(3):
        await_state(valve, HEALTHY)
        for step, expected in steps:
            for node in NAMES:
                done = valve.call(
                    ChangeState, f'{node}/change_state', transition=Transition(id=step)
                )
                assert done.success, (node, step)
            assert valve.run_until(
                lambda n=expected: (
                    graph.count_publishers('/estimate') == n
                    and graph.count_publishers('/fault_flag') == n
                    and graph.count_subscribers('/measurement') == n
                )
            )
            services = {name for name, _ in graph.get_service_names_and_types()}
            assert ('/acknowledge' in services) == ('/relearn' in services) == bool(expected)
    assert not any(map(processes.ended, NAMES))


HOSTILE = 'TAG" innerHTML="<img src=x>\x1b[31m\n' + 'x' * 100_000


def test_hostile_text_comes_out_short_and_without_controls(processes, peer):
    valve = start(processes, peer)
    actions = peer.listen(OperatorAction, 'operator_action', qos.EVENTS)
    valve.raise_alarm()
    assert valve.call(Acknowledge, 'acknowledge', user=HOSTILE, comment=HOSTILE).success
    assert valve.run_until(lambda: actions and 'TAG' in valve.events[-1].text)
    assert len(valve.events[-1].text) <= 1000
    texts = [valve.events[-1].text, actions[-1].user, actions[-1].comment, actions[-1].result]
    assert all(text.isprintable() for text in texts)
    assert len(actions[-1].user) <= 100
    assert len(actions[-1].comment) <= 200
    assert (actions[-1].action, actions[-1].success) == (OperatorAction.ACKNOWLEDGE, True)
    assert actions[-1].occurrence == valve.flags[-1].occurrence
    assert not valve.call(Acknowledge, 'acknowledge', occurrence=999, user='Bert').success
    assert valve.run_until(lambda: actions[-1].user == 'Bert')
    assert not actions[-1].success
    file = processes.log('detector')
    assert valve.run_until(lambda: 'by Bert' in file.read_text()), 'requests are not logged'
    log = file.read_text()
    assert '\x1b' not in log
    assert max(map(len, log.splitlines())) < 2000
    assert valve.call(ResetAlarm, 'reset', user='Anna').success


def test_services_of_references_answer_with_absolute_paths(processes, peer, tmp_path):
    valve = start(processes, peer)
    for name in ('save_reference', 'load_reference'):
        answer = valve.call(Reference, name, path='/proc/self/mem')
        assert not answer.success
        assert 'is not below /' in answer.message
    assert not any(map(processes.ended, NAMES))


def test_a_tag_with_a_slash_is_a_tag_like_others(processes, peer, tmp_path):
    valve = start(processes, peer, str(tmp_path / 'alarms'), actuator='LV/101')
    await_state(valve, HEALTHY)
    assert valve.run_until(lambda: valve.report('detector'))
    assert valve.report('detector').hardware_id == 'LV/101'
    assert not any(map(processes.ended, NAMES))


def test_a_node_that_gives_way_takes_no_other_with_it(processes, peer):
    """Two processes with a common valve: the other valve of the second one goes on."""

    def words(*valves):
        found = []
        for valve in valves:
            for node in NAMES:
                found += ['--', node, *arguments_of(SETTINGS, namespace=valve)]
        return found[1:]

    flags = {v: peer.listen(FaultFlag, f'/{v}/fault_flag', qos.FLAG) for v in ('a1', 'b1')}
    processes.start('damadics_fd', 'monitors', words('a1'), 'first')
    assert peer.wait(lambda: flags['a1'])
    peer.wait(lambda: False, 5.0)
    processes.start('damadics_fd', 'monitors', words('a1', 'b1'), 'second')
    assert peer.wait(lambda: flags['b1'])
    log = processes.log('second')
    assert peer.wait(lambda: 'another detector sends' in log.read_text())
    before = len(flags['b1'])
    assert peer.wait(lambda: len(flags['b1']) > before + 3), 'the healthy valve has ended'
    assert not processes.ended('second')
    assert 'Traceback' not in log.read_text()
    assert log.read_text().count('FATAL') == 1


def test_a_position_frozen_while_the_control_value_moves_is_told_live(processes, peer):
    valve = start(processes, peer)
    await_state(valve, HEALTHY)
    valve.run(6.0, swing=True)
    assert valve.run_until(lambda: valve.says('estimator', 'position has not moved'))


@pytest.mark.parametrize(('newcomer', 'gives_way'), [(0.0, False), (60.0, True)])
def test_of_two_detectors_the_first_stays_and_says_that_there_is_another(
    peer, monkeypatch, newcomer, gives_way
):
    """As after SIGSTOP of a detector, start of a second and SIGCONT: both were there first."""
    monkeypatch.setattr(second_publisher, 'NEWCOMER', newcomer)
    refused = []
    entities = Entities(peer.node)
    rival = second_publisher.RivalWatch(peer.node, entities, refused.append)
    another = peer.node.create_publisher(FaultFlag, 'fault_flag', qos.FLAG)
    assert peer.wait(lambda: another.get_subscription_count() > 0)
    assert not rival.problem
    another.publish(FaultFlag())
    assert peer.wait(lambda: rival.problem)
    assert 'another detector judges this valve too' in rival.problem
    assert bool(refused) == gives_way
    entities.release()
