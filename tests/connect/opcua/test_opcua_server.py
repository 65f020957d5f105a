# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Judgements on our OPC UA server, read by asyncua and by a foreign stack (node-opcua)."""

import asyncio
import json
import shutil
import subprocess
from pathlib import Path

import pytest
from asyncua import Client, Server, ua
from conftest import PATIENCE, ended, free_port
from connect.detectors import Detectors
from connect.servers import listens, wait_for
from damadics_bringup.processes import executable
from damadics_msgs.msg import FaultEvent

pytestmark = pytest.mark.ros
OPERATOR, VIEWER = 'operator-0123456789abcdef', 'viewer-0123456789abcdef'
FOREIGN = Path(__file__).parents[1] / 'foreign'
PADIM = 'http://opcfoundation.org/UA/PADIM/'
DI = 'http://opcfoundation.org/UA/DI/'
ALARM = ua.ObjectIds.AlarmConditionType


class Events:
    """Keeps events of a subscription."""

    def __init__(self) -> None:
        self.got = []

    def event_notification(self, event) -> None:
        self.got.append(event)

    async def wait(self, condition, patience: float = PATIENCE):
        for _ in range(int(patience / 0.05)):
            if found := [event for event in self.got if condition(event)]:
                return found[-1]
            await asyncio.sleep(0.05)
        return None


@pytest.fixture
def served(processes, domain, tmp_path):
    port = free_port()
    (tmp_path / 'tokens').write_text(f'operator {OPERATOR} Ann Example\nviewer {VIEWER}\n')
    (tmp_path / 'out.yaml').write_text(
        f'serve:\n  endpoint: opc.tcp://127.0.0.1:{port}\n  token_file: tokens\n'
    )
    with Detectors(domain, 'lv101', 'lv102') as detectors:
        processes.start('damadics_connect', 'opcua', [str(tmp_path / 'out.yaml')])
        log = processes.log('opcua')
        assert wait_for(lambda: listens(port)), log.read_text()
        yield f'opc.tcp://127.0.0.1:{port}', detectors, log
    assert OPERATOR not in log.read_text() and 'Traceback' not in log.read_text()


def client_of(url: str, token: str) -> Client:
    client = Client(url, timeout=10)
    client.set_user('somebody')
    client.set_password(token)
    return client


async def shows(client, path: str, value=None, status=ua.StatusCodes.Good) -> bool:
    """Wait until a variable shows a value with a status: each valve is written for itself."""
    own = await client.get_namespace_index('urn:damadics:fd')
    found = None
    for _ in range(int(PATIENCE / 0.1)):
        try:
            found = await client.get_node(ua.NodeId(path, own)).read_data_value(False)
            if found.StatusCode.value == status and found.Value.Value == value:
                return True
        except ua.UaError as missing:
            found = missing
        await asyncio.sleep(0.1)
    raise AssertionError(f'{path} is not {value} ({status:#x}), but {found}')


def test_a_fault_is_a_condition_that_an_operator_acknowledges(served):
    url, detectors, log = served

    async def watch():
        async with client_of(url, OPERATOR) as client, client_of(url, VIEWER) as viewer:
            assert await shows(client, 'lv101.DeviceHealth', 0)
            padim, di = [await client.get_namespace_index(uri) for uri in (PADIM, DI)]
            own = await client.get_namespace_index('urn:damadics:fd')
            path = ['0:Objects', f'{own}:Valves', f'{own}:LV101', f'{di}:DeviceHealth']
            health = await client.nodes.root.get_child(path)
            kind = await (await health.get_parent()).read_type_definition()
            assert kind == ua.NodeId(1009, padim)
            events = Events()
            subscription = await client.create_subscription(100, events)
            await subscription.subscribe_alarms_and_conditions(evtypes=ALARM)
            detectors.judge('lv101', FaultEvent.RAISED, 'friction up', cause='friction_up')
            raised = await events.wait(lambda e: getattr(e, 'ActiveState/Id', False))
            assert raised is not None, log.read_text()
            assert raised.Message.Text == 'friction up' and raised.Severity == 700
            assert raised.Retain and getattr(raised, 'AckedState/Id') is False
            assert await shows(client, 'lv101.DeviceHealth', 3), 'off spec'
            assert await shows(client, 'lv101.Ratio', 2.0)
            assert await shows(client, 'lv101.Cause', 'friction_up')

            condition = client.get_node(ua.NodeId('lv101.Alarm', own))
            method = ua.NodeId(ua.ObjectIds.AcknowledgeableConditionType_Acknowledge)
            words = ua.LocalizedText('seen')
            refused = viewer.get_node(condition.nodeid)
            with pytest.raises(ua.uaerrors.BadUserAccessDenied):
                await refused.call_method(method, raised.EventId, words)
            with pytest.raises(ua.uaerrors.BadEventIdUnknown):
                await condition.call_method(method, b'another', words)
            await condition.call_method(method, raised.EventId, words)
            assert detectors.calls[-1] == ('lv101', 'acknowledge', 'Ann Example', 'seen')
            assert await events.wait(lambda e: getattr(e, 'AckedState/Id', False) and e.Retain)
            late = Events()
            again = await viewer.create_subscription(100, late)
            await again.subscribe_alarms_and_conditions(evtypes=ALARM)
            refresh = ua.NodeId(ua.ObjectIds.ConditionType_ConditionRefresh)
            kind = viewer.get_node(ua.ObjectIds.ConditionType)
            number = ua.Variant(again.subscription_id, ua.VariantType.UInt32)
            await kind.call_method(refresh, number)
            assert await late.wait(lambda e: getattr(e, 'ActiveState/Id', False))
            with pytest.raises(ua.UaError):
                await health.write_value(ua.Variant(0, ua.VariantType.Int32))
            detectors.silence()
            lost = ua.StatusCodes.BadNoCommunication
            assert await shows(client, 'lv101.Residual', status=lost)
            assert await shows(client, 'lv102.DeviceHealth', 2), 'check function, not normal'

    asyncio.run(watch())


def test_a_wrong_token_does_not_enter(served):
    url, _, _ = served

    async def enter():
        async with client_of(url, 'operator-0000000000000000'):
            pass

    with pytest.raises(ua.UaStatusCodeError):
        asyncio.run(enter())


@pytest.mark.skipif(
    not shutil.which('node') or not (FOREIGN / 'node_modules').is_dir(),
    reason='needs Node.js and, once: npm ci --prefix tests/connect/foreign',
)
def test_a_foreign_stack_reads_and_hears_the_same(served):
    url, detectors, log = served
    assert wait_for(lambda: 'serving judgements' in log.read_text())
    begun = subprocess.Popen(
        ['node', str(FOREIGN / 'read.mjs'), url, VIEWER],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    with ended(begun) as reader:
        for line in reader.stdout:  # the stack talks, too
            if line == 'listening\n':
                break
        else:
            pytest.fail(reader.stderr.read())
        detectors.judge('lv101', FaultEvent.RAISED, 'friction up')
        out, problem = reader.communicate(timeout=PATIENCE)
        assert reader.returncode == 0, problem
    told = json.loads(next(line for line in out.splitlines() if line.startswith('{')))
    assert told['browse'] == 'LV101' and told['type'] == 'PADIMType'
    assert told['event']['message'] == 'friction up'
    assert told['event']['active'] is True and told['event']['acknowledged'] is False
    assert told['health'] == 3 and told['ratio'] == 2.0


NODESET = """<?xml version="1.0" encoding="utf-8"?>
<UANodeSet xmlns="http://opcfoundation.org/UA/2011/03/UANodeSet.xsd">
  <NamespaceUris><Uri>{uri}</Uri></NamespaceUris>
  <Models><Model ModelUri="{uri}" Version="1.02" PublicationDate="2021-01-01T00:00:00Z">
    <RequiredModel ModelUri="http://opcfoundation.org/UA/" Version="1.05.02"
      PublicationDate="2022-11-01T00:00:00Z" /></Model></Models>
  <Aliases><Alias Alias="HasSubtype">i=45</Alias></Aliases>
  <UAObjectType NodeId="ns=1;i={number}" BrowseName="1:{name}">
    <DisplayName>{name} of the file</DisplayName>
    <References>
      <Reference ReferenceType="HasSubtype" IsForward="false">i=58</Reference>
    </References>
  </UAObjectType>
</UANodeSet>
"""


def test_the_types_of_a_nodeset_file_are_used_where_there_is_one(tmp_path):
    from damadics_connect.opcua.address_space import ValveObject, prepare

    files = []
    for uri, number, name in ((DI, 1001, 'TopologyElementType'), (PADIM, 1009, 'PADIMType')):
        files.append(tmp_path / f'{name}.xml')
        files[-1].write_text(NODESET.format(uri=uri, number=number, name=name))

    async def look():
        server = Server()
        await server.init()
        spaces = await prepare(server, files)
        kind = server.get_node(spaces.type_id)
        assert (await kind.read_display_name()).Text == 'PADIMType of the file'
        assert spaces.padim == await server.get_namespace_index(PADIM)
        valve = ValveObject(server, spaces)
        await valve.make(server.nodes.objects, 'lv101', 'LV-101')
        assert await valve.node.read_type_definition() == spaces.type_id

    asyncio.run(look())


@pytest.mark.parametrize(
    'content', ['<a', NODESET.replace('i=58', 'ns=7;i=1')], ids=['cut', 'odd']
)
def test_a_nodeset_file_that_cannot_be_taken_in_is_told_in_one_line(domain, tmp_path, content):
    (tmp_path / 'a.xml').write_text(content.format(uri=PADIM, number=1009, name='PADIMType'))
    (tmp_path / 'out.yaml').write_text(
        f'serve: {{endpoint: "opc.tcp://127.0.0.1:{free_port()}", nodesets: [a.xml]}}\n'
    )
    done = subprocess.run(
        [executable('damadics_connect', 'opcua'), str(tmp_path / 'out.yaml')],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert done.returncode != 0
    assert 'serve.nodesets: cannot be taken in' in done.stderr
    assert 'Traceback' not in done.stderr
