# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Launch files, parameter files, layouts, policy: what they name has to exist."""

import argparse
import importlib.util
import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
import yaml
from ament_index_python.packages import get_package_share_directory
from conftest import PATIENCE
from damadics_bringup.launcher import tasks_of
from damadics_bringup.policy import policy
from damadics_bringup.processes import executable, parameters
from damadics_bringup.respawn import unless_refused
from damadics_fd.store.fleet_file import FleetError, Valve, read_fleet
from damadics_msgs import msg
from permissions import allowed

SHARE = Path(get_package_share_directory('damadics_bringup'))
LAUNCH = sorted((SHARE / 'launch').glob('*.launch.py'))


class Configuration:
    """Stand-in of `LaunchConfiguration`."""

    values: dict[str, str] = {}

    def __init__(self, name: str) -> None:
        self.name = name

    def perform(self, context) -> str:
        return self.values[self.name]


def described(path: Path, monkeypatch, **given: str) -> list:
    """Run a launch file with stand-ins of `launch` that only remember."""

    def remember(kind):
        return lambda *args, **kwargs: SimpleNamespace(kind=kind, args=args, **kwargs)

    modules = {
        'launch': {'LaunchDescription': lambda actions: actions},
        'launch.actions': {
            name: remember(name) for name in ('DeclareLaunchArgument', 'OpaqueFunction')
        },
        'launch.conditions': {'IfCondition': remember('IfCondition')},
        'launch.substitutions': {'LaunchConfiguration': Configuration},
        'launch_ros': {},
        'launch_ros.actions': {'Node': remember('Node')},
    }
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location(path.stem.replace('.', '_'), path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    actions = module.generate_launch_description()
    Configuration.values = {
        a.args[0]: getattr(a, 'default_value', '')
        for a in actions
        if a.kind == 'DeclareLaunchArgument'
    } | given
    for action in list(actions):
        if action.kind == 'OpaqueFunction':
            actions += action.function(None)
    return actions


@pytest.mark.parametrize('path', LAUNCH, ids=lambda path: path.name)
def test_a_launch_file_starts_what_there_is(path, monkeypatch):
    actions = described(path, monkeypatch)
    nodes = [action for action in actions if action.kind == 'Node']
    assert {'estimator', 'detector'} <= {node.executable for node in nodes}
    for node in nodes:
        assert executable(node.package, node.executable)
    declared = {a.args[0] for a in actions if a.kind == 'DeclareLaunchArgument'}
    used = set(re.findall(r"LaunchConfiguration\('(\w+)'\)", path.read_text()))
    assert used == declared


@pytest.mark.parametrize('path', LAUNCH, ids=lambda path: path.name)
def test_launch_starts_a_node_again_unless_it_refused_what_it_was_given(path, monkeypatch):
    actions = described(path, monkeypatch)
    again = [action for action in actions if getattr(action, 'respawn', False)]
    if not again:
        pytest.skip('it starts nothing again')
    assert again and all(n.on_exit is unless_refused and n.respawn_delay for n in again)
    monkeypatch.setattr(
        sys.modules['launch.actions'], 'EmitEvent', lambda event: event, raising=False
    )
    for name, content in (
        ('launch.events', {'matches_action': lambda action: action}),
        ('launch.events.process', {'ShutdownProcess': lambda process_matcher: process_matcher}),
    ):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
        vars(sys.modules[name]).update(content)
    for node in again:
        for code, given_up in ((0, []), (1, []), (-9, []), (2, [node])):
            event = SimpleNamespace(returncode=code, action=node)
            assert node.on_exit(event, None) == given_up


@pytest.mark.parametrize('path', LAUNCH, ids=lambda path: path.name)
def test_a_launch_file_hands_the_tokens_to_the_page(path, monkeypatch):
    if 'dashboard' not in path.read_text():
        pytest.skip('it starts no page')
    given = {'host': '0.0.0.0', 'token_file': '/etc/tokens'}
    page = next(
        a
        for a in described(path, monkeypatch, **given)
        if a.kind == 'Node' and a.executable == 'dashboard'
    )
    assert page.arguments == ['--host', '0.0.0.0', '--token-file', '/etc/tokens']
    page = next(
        a for a in described(path, monkeypatch) if a.kind == 'Node' and a.executable == 'dashboard'
    )
    assert page.arguments == ['--host', '127.0.0.1']


@pytest.mark.parametrize('processes', [0, 2])
def test_the_fleet_launch_file_and_the_run_command_start_the_same(processes, monkeypatch):
    valves = read_fleet(SHARE / 'config' / 'fleet.yaml')
    path = SHARE / 'launch' / 'fleet.launch.py'
    launched = [
        (
            getattr(node, 'namespace', ''),
            node.executable,
            node.arguments if node.executable == 'monitors' else [],
        )
        for node in described(path, monkeypatch, processes=str(processes))
        if node.kind == 'Node' and node.executable not in ('recorder', 'dashboard')
    ]
    options = argparse.Namespace(record=None, dashboard=False, simulate=True, processes=processes)
    ran = [
        (
            task.label.rpartition('/')[0],
            task.executable,
            task.arguments if task.executable == 'monitors' else [],
        )
        for task in tasks_of(valves, options)
    ]
    assert sorted(launched) == sorted(ran)
    assert len(ran) == len(valves) + (processes or 2 * len(valves))


def test_nodes_of_one_process_share_its_enclave():
    valves = [Valve('lv1'), Valve('lv2'), Valve('lv3')]
    enclaves = {
        enclave.get('path'): {(p.get('ns'), p.get('node')) for p in enclave.iter('profile')}
        for enclave in policy(valves, processes=2).getroot().iter('enclave')
    }
    assert enclaves['/monitors_1'] == {
        (f'/{valve}', node) for valve in ('lv1', 'lv3') for node in ('estimator', 'detector')
    }
    assert enclaves['/lv1/driver'] == {('/lv1', 'driver')}
    assert not {'/lv1/detector', '/lv2/estimator'} & set(enclaves)


@pytest.mark.parametrize('name', ['estimator', 'detector'])
def test_the_parameter_file_is_taken_by_the_node(name, tmp_path):
    """A wrong parameter beside the file is the only complaint."""
    wrong = [*parameters(no_such='x'), '--params-file', str(SHARE / 'config/valve.param.yaml')]
    done = subprocess.run(
        [executable('damadics_fd', name), *wrong], capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 2
    complaints = [line for line in done.stderr.splitlines() if line.startswith('  ')]
    assert complaints == ['  no_such: there is no such parameter']


def test_replay_takes_the_arguments_that_launch_adds(tmp_path):
    command = [
        executable('damadics_fd', 'replay'),
        str(tmp_path / 'none.mcap'),
        '--live',
        '--inputs-only',
        '--ros-args',
        '--enclave',
        '/replay',
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert 'unrecognized arguments' not in done.stderr
    assert 'none.mcap' in done.stderr


def test_all_mistakes_in_a_fleet_are_listed(tmp_path):
    path = tmp_path / 'fleet.yaml'
    path.write_text(
        yaml.safe_dump(
            {
                'valves': {
                    'LV 1': {},
                    'lv2': {'parameter': 'x'},
                    'lv3': {'parameters': 'none.yaml'},
                    'lv4': {'topics': {'measurment': '/x'}},
                    'lv5': {'settings': {'reference': 'r'}},
                    'lv6': {'settings': {'reference': 'r'}},
                    'area/lv7': {},
                    'area__lv7': {},
                }
            }
        )
    )
    with pytest.raises(FleetError) as caught:
        read_fleet(path)
    for cause in (
        'LV 1: a name consists',
        'lv2: there is no entry parameter',
        'none.yaml does not',
        'lv4: there is no topic measurment',
        'lv6: lv5 has the reference r too',
        'area__lv7: its files have the names of those of area/lv7',
    ):
        assert cause in str(caught.value)
    for text in ('', 'valves: []', 'valves: {a: [1]}', ': :', 'valves: {a: {}, b: {}, a: {}}'):
        path.write_text(text)
        with pytest.raises(FleetError):
            read_fleet(path)


def fields(topic: str) -> set[str]:
    kinds = {
        'measurement': msg.Measurement,
        'estimate': msg.Estimate,
        'residual': msg.Float64Stamped,
        'threshold': msg.Float64Stamped,
        'fault_flag': msg.FaultFlag,
    }
    return set(kinds[topic].get_fields_and_field_types())


def test_the_layouts_name_topics_and_fields_that_exist():
    foxglove = (SHARE / 'layouts' / 'foxglove_valve.json').read_text()
    json.loads(foxglove)
    juggler = SHARE / 'layouts' / 'plotjuggler_valve.xml'
    ET.parse(juggler)
    named = re.findall(r'"/lv101/(\w+)\.(\w+)"', foxglove)
    named += re.findall(r'(?:name|curve_x|curve_y)="/lv101/(\w+)/(\w+)"', juggler.read_text())
    assert len(named) > 12
    # as plotjuggler-ros-plugins reads it; curves of other topics would stay empty
    plugin = ET.parse(juggler).find('Plugins/plugin[@ID="ROS2 Topic Subscriber"]')
    taken = set(plugin.find('selected_topics').get('value').split(';'))
    curves = [
        e.get(k)
        for e in ET.parse(juggler).iter('curve')
        for k in ('name', 'curve_x', 'curve_y')
        if (e.get(k) or '').startswith('/')
    ]
    assert {curve.rpartition('/')[0] for curve in curves} <= taken
    panels = json.loads(foxglove)['configById']
    assert {name.partition('!')[0] for name in panels} == {
        'Plot',
        'StateTransitions',
        'RawMessages',
        'DiagnosticSummary',
    }
    assert all(name in json.dumps(json.loads(foxglove)['layout']) for name in panels)
    for topic, field in named:
        assert field in fields(topic), f'{topic}.{field}'


@pytest.fixture(scope='module')
def secured(tmp_path_factory):
    """The policy of the shipped fleet, with one topic elsewhere on the plant."""
    folder = tmp_path_factory.mktemp('policy')
    fleet = yaml.safe_load((SHARE / 'config' / 'fleet.yaml').read_text())
    for valve in fleet['valves'].values():
        del valve['parameters']
    fleet['valves']['fv203']['topics'] = {'measurement': '/plc/fv203'}
    (folder / 'fleet.yaml').write_text(yaml.safe_dump(fleet))
    command = [
        executable('damadics_bringup', 'policy'),
        str(folder / 'fleet.yaml'),
        '--simulate',
        '--out',
        str(folder / 'policy.xml'),
    ]
    subprocess.run(command, check=True, timeout=PATIENCE)
    return folder / 'policy.xml'


def rights(policy: Path | ET.ElementTree, verb: str) -> dict[str, set[str]]:
    """Return what the nodes may publish, subscribe, reply or request: full names by node."""
    found: dict[str, set[str]] = {}
    tree = ET.parse(policy) if isinstance(policy, Path) else policy
    for profile in tree.iter('profile'):
        node = f'{profile.get("ns").rstrip("/")}/{profile.get("node")}'
        found[node] = allowed(profile, verb)
    return found


def test_the_policy_lets_nobody_but_the_detector_raise_a_flag(secured):
    for verb, name, owners in (
        ('publish', '/lv101/fault_flag', {'/lv101/detector'}),
        ('publish', '/lv101/estimate', {'/lv101/estimator'}),
        ('publish', '/plc/fv203', {'/fv203/driver', '/fv203/plant'}),
        ('request', '/lv101/reset', {'/dashboard'}),
        ('subscribe', '/plc/fv203', {'/fv203/estimator', '/dashboard', '/recorder'}),
    ):
        assert {n for n, names in rights(secured, verb).items() if name in names} == owners


def test_the_policy_lets_the_page_hear_what_it_shows(secured):
    shown = {'measurement', 'estimate', 'threshold', 'fault_flag', 'fault_event'}
    shown |= {'signature', 'isolation', 'operator_action'}
    assert {f'/lv101/{name}' for name in shown} <= rights(secured, 'subscribe')['/dashboard']


def test_the_policy_has_what_ros2_security_reads(secured):
    """Version, elements and attributes as in the schema of sros2, and that itself where it is."""
    root = ET.parse(secured).getroot()
    assert (root.tag, root.get('version')) == ('policy', '0.2.0')
    paths = [e.get('path') for e in root.findall('enclaves/enclave')]
    assert len(paths) == len(set(paths)) == 3 * 4 + 2
    for profile in root.findall('enclaves/enclave/profiles/profile'):
        assert set(profile.attrib) == {'ns', 'node'}
        for group in profile:
            assert group.tag in ('topics', 'services')
            assert set(group.attrib.values()) == {'ALLOW'}
            assert len(group), 'an empty list is refused'
    sros2 = pytest.importorskip('sros2.policy', reason='sros2 comes with an installed ROS 2 only')
    sros2.load_policy(secured)


def test_without_keys_an_enforced_node_does_not_start(tmp_path):
    enforced = {
        'ROS_SECURITY_ENABLE': 'true',
        'ROS_SECURITY_STRATEGY': 'Enforce',
        'ROS_SECURITY_KEYSTORE': str(tmp_path / 'none'),
    }
    done = subprocess.run(
        [executable('damadics_fd', 'detector'), *parameters(mode='paper')],
        env={**os.environ, **enforced},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode != 0
    assert 'security' in done.stderr.lower() or 'keystore' in done.stderr.lower()
