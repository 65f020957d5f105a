# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Launch file, `run` and policy with one node for all valves."""

from damadics_bringup.launcher import main, parser, tasks_of
from damadics_bringup.policy import policy
from damadics_fd.store.fleet_file import Valve, read_fleet
from test_operations_files import SHARE, described, rights


def test_one_node_judges_all_valves_where_blocks_are_asked_for(monkeypatch):
    path = SHARE / 'launch' / 'fleet.launch.py'
    file = SHARE / 'config' / 'fleet.yaml'
    nodes = [n for n in described(path, monkeypatch, blocks='true') if n.kind == 'Node']
    assert {n.executable for n in nodes} == {'fleet', 'recorder', 'dashboard', 'plant'}
    words = [str(file), '--blocks', '--dashboard']
    tasks = tasks_of(read_fleet(file), parser().parse_args(words))
    assert [task.executable for task in tasks] == ['fleet', 'dashboard']
    assert tasks[0].arguments == [str(file), '--ros-args', '--enclave', '/fleet']
    tasks = tasks_of(read_fleet(file), parser().parse_args([*words, '--simulate']))
    assert 'expose:=3' in tasks[0].arguments, 'plants send valve by valve'
    assert main([str(file), '--blocks', '--processes', '2']) == 2


def test_the_policy_of_blocks_has_one_node_for_all_valves():
    found = policy([Valve('lv1'), Valve('lv2')], blocks=True)
    for verb, name, owners in (
        ('publish', '/fleet/status', {'/fleet'}),
        ('publish', '/lv2/fault_flag', {'/fleet'}),
        ('subscribe', '/measurement_block', {'/fleet', '/recorder'}),
        ('subscribe', '/fleet/status', {'/dashboard', '/recorder'}),
        ('subscribe', '/fleet/layout', {'/fleet', '/dashboard', '/recorder'}),
        ('reply', '/fleet/shelve', {'/fleet'}),
        ('request', '/fleet/shelve', {'/dashboard'}),
    ):
        assert {n for n, names in rights(found, verb).items() if name in names} == owners, name
