# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Judgements written into the plant's own server: the nodes that are named, and no others."""

import asyncio
import math
import subprocess

import pytest
import yaml
from asyncua import Client
from conftest import PATIENCE
from connect.detectors import Detectors
from connect.servers import Server, wait_for
from damadics_bringup.processes import executable
from damadics_msgs.msg import FaultEvent

pytestmark = pytest.mark.ros
NAMES = ('HEALTH', 'FAULT', 'RATIO', 'CAUSE', 'BEAT', 'OTHER', 'LOCKED')
NORMAL, FAILURE, CHECK, OFF_SPEC = 0, 1, 2, 3  # DeviceHealthEnumeration of OPC 10000-100


class Plant:
    """A server of the plant and a connector that writes to it."""

    def __init__(self, processes, folder, *options, **outputs) -> None:
        self.server = Server(folder, 'opcua_server.py', 1, *options)
        self.url = f'opc.tcp://127.0.0.1:{self.server.port}'
        nodes = {name: f'ns=2;s=FD.{node}' for name, node in outputs.items()}
        beat = nodes.pop('heartbeat', None)
        write = {'valves': {'lv101': nodes}} | ({'heartbeat': beat} if beat else {})
        (folder / 'plant.yaml').write_text(yaml.safe_dump({'server': self.url, 'write': write}))
        self.processes = processes
        processes.start('damadics_connect', 'opcua', [str(folder / 'plant.yaml')])

    def read(self) -> dict:
        async def values():
            async with Client(self.url, timeout=PATIENCE) as client:
                nodes = [client.get_node(f'ns=2;s=FD.{name}') for name in NAMES]
                nodes.append(client.get_node('ns=2;s=LV0.PV'))
                return [await node.read_value() for node in nodes]

        return dict(zip((*NAMES, 'PV'), asyncio.run(values()), strict=True))

    def shows(self, **wanted) -> bool:
        return wait_for(lambda: wanted.items() <= self.read().items(), pause=0.2)

    def log(self) -> str:
        return self.processes.log('opcua').read_text(errors='replace')


@pytest.mark.parametrize('options', [(), ('--at-once', '2')], ids=['', 'little at once'])
def test_judgements_stand_in_the_named_nodes_and_nothing_else_is_touched(
    processes, domain, tmp_path, options
):
    with Detectors(domain, 'lv101') as detectors:
        plant = Plant(
            processes, tmp_path, *options, health='HEALTH', fault='FAULT', ratio='RATIO',
            cause='CAUSE', heartbeat='BEAT',
        )  # fmt: skip
        try:
            assert plant.shows(HEALTH=NORMAL, FAULT=False, RATIO=0.1, CAUSE=''), plant.log()
            detectors.judge('lv101', FaultEvent.RAISED, cause='friction_up')
            assert plant.shows(HEALTH=OFF_SPEC, FAULT=True, RATIO=2.0, CAUSE='friction_up')
            beat = plant.read()['BEAT']
            assert wait_for(lambda: plant.read()['BEAT'] != beat)
            plant.server.kill()
            plant.server.start()
            assert plant.shows(HEALTH=OFF_SPEC, CAUSE='friction_up'), 'again, without a person'
            detectors.judge('lv101', FaultEvent.CLEARED)
            detectors.judge('lv101', FaultEvent.RESET)
            assert plant.shows(HEALTH=NORMAL, FAULT=False)
            detectors.silence()
            assert plant.shows(HEALTH=CHECK), 'nobody judges it any more'
            now = plant.read()
            assert math.isnan(now['RATIO'])
            assert (now['OTHER'], now['LOCKED'], now['PV']) == (-1.0, -1.0, 0.5)
        finally:
            plant.server.kill()
    assert 'Traceback' not in plant.log()


def test_who_leaves_leaves_no_healthy_valve_behind(processes, domain, tmp_path):
    with Detectors(domain, 'lv101'):
        plant = Plant(processes, tmp_path, health='HEALTH')
        try:
            assert plant.shows(HEALTH=NORMAL), plant.log()
            processes.end('opcua')
            assert plant.read()['HEALTH'] == CHECK
        finally:
            plant.server.kill()


def test_what_cannot_be_written_is_told_once_and_the_others_are_written(
    processes, domain, tmp_path
):
    with Detectors(domain, 'lv101'):
        plant = Plant(
            processes, tmp_path, health='HEALTH', ratio='LOCKED', cause='OTHER', fault='NO.SUCH'
        )
        try:
            assert plant.shows(HEALTH=NORMAL), plant.log()
            (line,) = [line for line in plant.log().splitlines() if 'not written' in line]
            for words in (
                'lv101.ratio (ns=2;s=FD.LOCKED: the server does not let us write it)',
                'lv101.cause (ns=2;s=FD.OTHER: is Double: has to be String)',
                'lv101.fault (ns=2;s=FD.NO.SUCH: no such node)',
                'all others are',
            ):
                assert words in line
            assert plant.read()['LOCKED'] == plant.read()['OTHER'] == -1.0
        finally:
            plant.server.kill()


def test_mistakes_under_write_are_told_at_once(domain, tmp_path):
    path = tmp_path / 'wrong.yaml'
    path.write_text("""
        server: opc.tcp://127.0.0.1:1
        valves: {lv101: {signals: {cv: ns=2;s=CV, x1: ns=2;s=PV}}}
        write:
          valves: {lv101: {health: ns=2;s=PV, rato: ns=2;s=R, fault: ns=2;s=F, text: ns=2;s=F}}
        """)
    program = executable('damadics_connect', 'opcua')
    done = subprocess.run([program, str(path)], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 2
    for words in (
        'write: lv101.health: ns=2;s=PV is read as x1 of lv101',
        'write.valves.lv101.rato: there is no such entry: do you mean ratio?',
        'write: lv101.text: ns=2;s=F is written as lv101.fault',
    ):
        assert words in done.stderr
    path.write_text('server: opc.tcp://127.0.0.1:1\nwrite: {}\n')
    done = subprocess.run([program, str(path)], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 2 and 'write: names no node' in done.stderr
