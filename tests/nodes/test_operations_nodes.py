# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Operation of the nodes as processes: services, restart, silence, collisions, time."""

import subprocess
import time
from functools import partial
from types import SimpleNamespace

import pytest
from conftest import PATIENCE, Peer, alone, promised
from damadics_bringup.launcher import arguments_of
from damadics_bringup.policy import policy
from damadics_bringup.processes import Processes, executable, parameters, surroundings
from damadics_fd.ros import qos
from damadics_fd.store.fleet_file import Valve as FleetEntry
from damadics_msgs.msg import (
    FaultEvent,
    FaultFlag,
    Measurement,
    OperatorAction,
    StrokeRequest,
)
from damadics_msgs.srv import Acknowledge, PartialStroke, Relearn, ResetAlarm, Shelve
from driven_valve import SETTINGS, Valve, start, wait_until_monitored
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from permissions import assert_allowed
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import QoSProfile, ReliabilityPolicy

pytestmark = pytest.mark.ros


@pytest.fixture(scope='module')
def plant(tmp_path_factory):
    """One estimator and one detector for the tests that leave them as they were."""
    folder = tmp_path_factory.mktemp('operations')
    with pytest.MonkeyPatch.context() as patch:
        domain = alone(patch, folder)
        peer = Peer(domain)
        with Processes(folder / 'logs', surroundings(domain)) as processes:
            alarms = str(folder / 'alarms')
            yield SimpleNamespace(
                valve=start(processes, peer, alarms), processes=processes, alarms=alarms
            )
        peer.close()


@pytest.fixture
def valve(plant):
    plant.valve.calm()
    return plant.valve


def test_services_say_what_was_done_or_why_not(valve):
    nothing = valve.call(Acknowledge, 'acknowledge')
    assert (nothing.success, nothing.message) == (False, 'there is no alarm to acknowledge')
    valve.run(0.3)
    assert valve.run_until(lambda: valve.flags[-1].fault, throw=True)
    throw = partial(valve.run_until, throw=True)
    refused = valve.peer.call(ResetAlarm, 'reset', throw, user='Anna')
    assert (refused.success, 'still active' in refused.message) == (False, True)
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_LATCHED)
    seen = valve.call(Acknowledge, 'acknowledge', user='Anna', comment='on my way')
    assert seen.success
    assert valve.run_until(lambda: valve.events[-1].transition == FaultEvent.ACKNOWLEDGED)
    assert valve.events[-1].text.endswith(', by Anna: on my way')
    assert 'before' in valve.call(Acknowledge, 'acknowledge').message
    assert not valve.call(Acknowledge, 'acknowledge', occurrence=77).success
    assert valve.call(ResetAlarm, 'reset', user='Anna', comment='packing replaced').success
    assert valve.run_until(lambda: not valve.flags[-1].fault)
    assert not valve.call(Shelve, 'shelve', duration=-1.0).success
    assert valve.call(Shelve, 'shelve', duration=600.0).success
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_SHELVED)
    assert valve.call(Shelve, 'shelve').success
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_HEALTHY)
    refused = valve.call(Relearn, 'relearn')
    assert (refused.success, 'paper' in refused.message) == (False, True)


def test_partial_strokes_end_with_the_measurement_and_are_refused_under_an_alarm(valve):
    asked = valve.peer.listen(StrokeRequest, 'stroke_request', qos.COMMANDS)
    ask = {'amplitude': 0.05, 'count': 3, 'user': 'Anna', 'comment': 'monthly check'}
    # the detector may first have to discover who takes its requests
    assert valve.run_until(
        lambda: asked or (valve.call(PartialStroke, 'partial_stroke', **ask).success and asked)
    )
    assert [(m.amplitude, m.count) for m in asked] == [(0.05, 3)]
    assert 'going on' in valve.call(PartialStroke, 'partial_stroke', **ask).message
    assert valve.peer.wait(lambda: len(asked) > 1), 'the valve was lost, the strokes went on'
    assert (asked[1].request, asked[1].count) == (asked[0].request, 0)
    valve.raise_alarm()
    assert 'alarm stands' in valve.call(PartialStroke, 'partial_stroke', **ask).message
    assert len(asked) == 2


def test_a_late_joiner_gets_the_flag_and_all_events(valve):
    valve.raise_alarm()
    assert valve.call(Acknowledge, 'acknowledge').success
    assert valve.run_until(lambda: valve.events[-1].transition == FaultEvent.ACKNOWLEDGED)
    late_flags = valve.peer.listen(FaultFlag, 'fault_flag', qos.FLAG)
    late = valve.peer.listen(FaultEvent, 'fault_event', qos.EVENTS)
    last = str(valve.events[-1])  # a NaN is not equal to itself
    assert valve.run_until(lambda: late and late_flags and str(late[-1]) == last)
    assert FaultEvent.RAISED in {event.transition for event in late}
    assert late_flags[0].fault


def test_a_killed_detector_comes_back_with_its_alarm_and_raises_no_other(valve, plant):
    valve.raise_alarm()
    assert valve.call(Acknowledge, 'acknowledge', user='Anna', comment='on my way').success
    valve.run(0.3)
    occurrence = valve.flags[-1].occurrence
    assert killed(valve, plant).fault, 'the alarm was lost'
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_LATCHED), (
        'the restarted detector does not judge'
    )
    valve.run(2.0)
    assert valve.flags[-1].occurrence == occurrence, 'the restart raised an alarm'
    again = valve.call(Acknowledge, 'acknowledge')
    assert 'acknowledged before' in again.message
    acts = valve.peer.listen(OperatorAction, 'operator_action', qos.EVENTS)
    assert valve.run_until(lambda: any(act.user == 'Anna' and act.success for act in acts)), (
        'what people did is told to who comes after the restart'
    )


def killed(valve: Valve, plant) -> FaultFlag:
    """Kill the detector and start it again; return its first flag."""
    plant.processes.kill('detector')
    valve.peer.clients.clear()  # whoever takes its place has to find them anew
    before = len(valve.flags)
    plant.processes.start(
        'damadics_fd', 'detector', parameters(alarm_folder=plant.alarms, **SETTINGS)
    )
    assert valve.run_until(lambda: len(valve.flags) > before)
    return valve.flags[before]


def test_an_active_and_a_shelved_alarm_survive_a_kill(valve, plant):
    valve.run(0.3)
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_ALARM, throw=True)
    occurrence = valve.flags[-1].occurrence
    first = killed(valve, plant)
    assert (first.fault, first.occurrence) == (True, occurrence)
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_LATCHED)
    assert valve.call(ResetAlarm, 'reset').success
    assert valve.call(Shelve, 'shelve', duration=600.0).success
    assert killed(valve, plant).state != FaultFlag.STATE_HEALTHY
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_SHELVED)
    assert valve.call(Shelve, 'shelve').success


def test_a_killed_estimator_stops_the_monitoring_within_half_a_second(valve, plant):
    occurrence = valve.flags[-1].occurrence
    plant.processes.kill('estimator')
    killed = time.monotonic()
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_NOT_MONITORING)
    took = time.monotonic() - killed
    plant.processes.start('damadics_fd', 'estimator', parameters(**SETTINGS))
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_HEALTHY)
    valve.run(1.0)
    assert valve.flags[-1].occurrence == occurrence, 'the restart raised an alarm'
    assert took < promised(0.5 + 1.0), 'timeout, one look and the steps of the test'


def test_a_second_publisher_on_measurement_is_reported(valve):
    assert valve.run_until(lambda: valve.report('estimator').level == b'\x00')
    second = valve.peer.node.create_publisher(Measurement, 'measurement', qos.SAMPLES)
    assert valve.run_until(lambda: valve.says('estimator', '2 publishers on /measurement'))
    assert valve.report('estimator').level == b'\x01'
    valve.peer.node.destroy_publisher(second)


def test_a_second_detector_of_the_same_valve_gives_way(valve, plant):
    second = subprocess.run(
        [executable('damadics_fd', 'detector'), *parameters(**SETTINGS)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert second.returncode == 1
    assert 'another detector sends on /fault_flag' in second.stderr
    assert plant.processes.exit_code('detector') is None, 'the first one has to stay'


def set_parameter(valve: Valve, node: str, name: str, value: float):
    given = Parameter(
        name=name, value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
    )
    return valve.call(SetParameters, f'{node}/set_parameters', parameters=[given]).results[0]


def test_parameters_are_checked_before_they_are_applied(valve, plant):
    assert 'read-only' in set_parameter(valve, 'detector', 'k2', 300.0).reason
    assert not set_parameter(valve, 'detector', 'input_timeout', -1.0).successful
    assert not set_parameter(valve, 'detector', 'input_timeout', float('nan')).successful
    assert set_parameter(valve, 'detector', 'input_timeout', 2.0).successful
    assert 'changed from 0.5 to 2 s' in plant.processes.log('detector').read_text()
    assert set_parameter(valve, 'detector', 'input_timeout', 0.5).successful


def test_hundreds_of_requests_at_once_are_all_answered(valve):
    kinds = {'acknowledge': Acknowledge, 'reset': ResetAlarm, 'shelve': Shelve}
    clients = [
        valve.peer.node.create_client(kind, name, qos_profile=QoSProfile(depth=1000))
        for name, kind in kinds.items()
    ]
    asked = {Shelve: {'duration': -1.0}}
    assert valve.run_until(lambda: all(client.service_is_ready() for client in clients))
    futures = [
        client.call_async(kind.Request(**asked.get(kind, {})))
        for _ in range(100)
        for client, kind in zip(clients, kinds.values(), strict=True)
    ]
    assert valve.run_until(lambda: all(future.done() for future in futures)), (
        f'{sum(not future.done() for future in futures)} of 300 requests were not answered'
    )
    assert not any(future.result().success for future in futures)


def test_an_inactive_node_takes_no_samples_and_says_so(valve):
    deactivate = Transition(id=Transition.TRANSITION_DEACTIVATE)
    assert valve.call(ChangeState, 'estimator/change_state', transition=deactivate).success
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_NOT_MONITORING)
    assert valve.run_until(lambda: valve.says('estimator', 'inactive'))
    activate = Transition(id=Transition.TRANSITION_ACTIVATE)
    assert valve.call(ChangeState, 'estimator/change_state', transition=activate).success
    assert valve.run_until(lambda: valve.flags[-1].state == FaultFlag.STATE_HEALTHY)


def test_a_publisher_with_another_quality_of_service_is_named(processes, peer):
    peer.node.destroy_publisher(peer.publisher)
    unreliable = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
    peer.publisher = peer.node.create_publisher(Measurement, 'measurement', unreliable)
    valve = start(processes, peer)
    assert valve.run_until(
        lambda: (
            'incompatible quality of service (reliability)'
            in processes.log('estimator').read_text()
        )
    )
    assert valve.run_until(lambda: valve.says('estimator', 'no measurement'))
    assert valve.report('estimator').level == b'\x02'
    assert valve.flags[-1].state == FaultFlag.STATE_NOT_MONITORING


def test_a_sample_a_second_is_no_silence_in_mode_scada(processes, peer):
    second = 1_000_000_000
    for name in ('estimator', 'detector'):
        processes.start('damadics_fd', name, parameters(mode='scada'))
    flags = peer.listen(FaultFlag, 'fault_flag', qos.FLAG)
    wait_until_monitored(peer, flags)
    peer.wait(lambda: False, 1.0)
    heard, n = len(flags), 0
    while all(flag.state != FaultFlag.STATE_LEARNING for flag in flags[heard:]):
        n += 1
        assert n < 60, 'no sample was taken'
        peer.send(n * second, 0.5, 0.5)  # the first loads compiled code
        peer.wait(lambda: False, 1.0)
    before = len(flags)
    for more in range(1, 6):
        peer.send((n + more) * second, 0.5, 0.5)
        peer.wait(lambda: False, 1.0)
    states = {flag.state for flag in flags[before:]}
    assert states == {FaultFlag.STATE_LEARNING}, 'a sample a second was taken for silence'
    assert peer.wait(lambda: flags[-1].state == FaultFlag.STATE_NOT_MONITORING)


def test_the_policy_of_a_fleet_allows_all_that_its_nodes_make(processes, peer):
    """With SROS 2 enforced, a node that may not make one of its topics does not start."""
    fleet = [FleetEntry('lv101')]
    for node in ('estimator', 'detector'):
        processes.start('damadics_fd', node, arguments_of({}, namespace='lv101'))
    processes.start(
        'damadics_plant',
        'plant',
        arguments_of({'rate': 50.0, 'publish_clock': True}, namespace='lv101'),
    )
    graph = peer.node
    services = ('/lv101/relearn', '/lv101/reset', '/lv101/inject_fault')
    assert peer.wait(
        lambda: set(services) <= {name for name, _ in graph.get_service_names_and_types()}, 60.0
    )
    assert peer.wait(
        lambda: (
            graph.count_publishers('/lv101/estimate')
            and graph.count_subscribers('/lv101/estimate')
        ),
        30.0,
    )
    document = policy(fleet, simulate=True)
    for name in ('estimator', 'detector', 'plant'):
        assert_allowed(peer, document, name, '/lv101')
