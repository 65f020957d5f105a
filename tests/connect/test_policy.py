# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The connectors under SROS 2: what they make is allowed, and they may do no more."""

import json

import pytest
from conftest import free_port
from damadics_bringup.policy import CONNECTORS, policy
from damadics_fd.ros import qos
from damadics_fd.store.fleet_file import Valve
from damadics_msgs.msg import FaultFlag
from permissions import allowed, assert_allowed

pytestmark = pytest.mark.ros


@pytest.mark.parametrize('publish', ['topics', 'blocks'])
def test_the_policy_allows_all_that_the_connectors_make(processes, peer, tmp_path, publish):
    """Servers and brokers need not be there for that."""
    (tmp_path / 'shift.url').write_text('json://127.0.0.1/')
    signals = {'cv': 'SP', 'x1': 'POS'}
    nodes = {'cv': 'ns=2;s=SP', 'x1': 'ns=2;s=POS'}
    configs = {
        'opcua': {
            'server': f'opc.tcp://127.0.0.1:{free_port()}',
            'serve': {'endpoint': f'opc.tcp://127.0.0.1:{free_port()}'},
            'valves': {'lv1': {'signals': nodes}},
            'publish': publish,
        },
        'mqtt': {
            'broker': f'mqtt://127.0.0.1:{free_port()}',
            'out': {'prefix': 'fd'},
            'valves': {'lv1': {'topic': 'plc/lv1', 'signals': signals}},
            'publish': publish,
        },
        'http': {'port': free_port()},
        'notify': {
            'targets': {'shift': {'url_file': 'shift.url'}},
            'rules': [{'to': ['shift']}],
        },
        'files': {
            'valves': {'lv1': {'path': 'lv1.csv', 'signals': signals}},
            'publish': publish,
        },
    }
    assert configs.keys() == CONNECTORS.keys()
    peer.node.create_publisher(FaultFlag, '/lv1/fault_flag', qos.FLAG)
    for name, config in configs.items():
        (tmp_path / f'{name}.yaml').write_text(json.dumps(config))
        processes.start('damadics_connect', name, [str(tmp_path / f'{name}.yaml')])
    graph = peer.node
    samples = {'topics': '/lv1/measurement', 'blocks': '/measurement_block'}[publish]
    assert peer.wait(lambda: graph.count_publishers(samples) == 3), logs(processes, configs)
    assert peer.wait(lambda: graph.count_subscribers('/lv1/fault_flag') == 4)
    document = policy([Valve('lv1')], connect=list(configs))
    for name in configs:
        assert_allowed(peer, document, name)


def logs(processes, names) -> str:
    return '\n'.join(processes.log(name).read_text() for name in names)


def test_a_connector_has_rights_only_where_it_runs():
    valves = [Valve('lv1', topics={'measurement': '/plc/lv1'})]
    profiles = {p.get('node'): p for p in policy(valves, connect=['files']).iter('profile')}
    assert CONNECTORS.keys() & profiles.keys() == {'files'}
    profiles = {p.get('node'): p for p in policy(valves, connect=CONNECTORS).iter('profile')}
    resets = {name for name, one in profiles.items() if '/lv1/reset' in allowed(one, 'request')}
    assert resets == {'dashboard', 'opcua', 'http'}
    assert '/fleet/reset' in allowed(profiles['http'], 'request')
    for name in CONNECTORS:
        flags = {n for n in allowed(profiles[name], 'publish') if 'fault' in n}
        assert not flags, f'{name} may raise {flags}'
        samples = {'/plc/lv1', '/measurement_block'} & allowed(profiles[name], 'publish')
        assert bool(samples) == (name in ('opcua', 'mqtt', 'files'))
