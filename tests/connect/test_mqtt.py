# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A real broker in another process: JSON and Sparkplug B in, judgements out, loss, bad input."""

import json
import math
import os
import signal
import time

import paho.mqtt.client as paho
import pytest
import yaml
from conftest import Peer
from connect.detectors import Detectors
from connect.servers import Server, wait_for
from damadics_connect.mqtt.sparkplug import Payload, read_payload, write_payload
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultEvent, Measurement
from diagnostic_msgs.msg import DiagnosticArray

pytestmark = pytest.mark.ros
MS = 1_000_000


class Program:
    """Another program at the broker."""

    def __init__(self, port: int, *topics: str) -> None:
        self.got: list[tuple[str, bytes, bool]] = []
        self.client = paho.Client(paho.CallbackAPIVersion.VERSION2)
        self.client.on_message = lambda c, u, m: self.got.append((m.topic, m.payload, m.retain))
        self.joined = 0  # how often it has subscribed
        self.client.on_connect = lambda c, *_: [c.subscribe(topic, 1) for topic in topics]
        self.client.on_subscribe = self._count
        self.client.reconnect_delay_set(1, 1)
        self.client.connect('127.0.0.1', port, 5)
        self.client.loop_start()
        assert wait_for(self.client.is_connected)

    def _count(self, *_) -> None:
        self.joined += 1

    def publish(self, topic: str, content, quality: int = 1) -> None:
        data = content if isinstance(content, bytes) else json.dumps(content).encode()
        self.client.publish(topic, data, quality).wait_for_publish(5.0)

    def of(self, topic: str) -> list[bytes]:
        return [payload for name, payload, _ in self.got if name == topic]

    def close(self) -> None:
        self.client.disconnect()
        self.client.loop_stop()


@pytest.fixture
def broker(tmp_path):
    server = Server(tmp_path, 'mqtt_broker.py')
    yield server
    server.kill()


def start(processes, folder, config: dict) -> None:
    (folder / 'mqtt.yaml').write_text(yaml.safe_dump(config, sort_keys=False))
    processes.start('damadics_connect', 'mqtt', [str(folder / 'mqtt.yaml')])


def stamp(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def test_samples_in_json_and_sparkplug(processes, domain, tmp_path, broker):
    percent = {'unit': '%', 'invert': True}
    start(
        processes,
        tmp_path,
        {
            'broker': f'mqtt://127.0.0.1:{broker.port}',
            'stamp': {'field': 'ts', 'unit': 'ms'},
            'period': 0.2,
            'valves': {
                'lv1': {
                    'topic': 'plant/lv1',
                    'signals': {
                        'cv': {'field': 'sp', **percent},
                        'x1': {'field': 'pos.value', **percent},
                        'p1': {'field': 'p1', 'unit': 'bar'},
                        'p2': {'field': 'p2', 'unit': 'bar'},
                        'ps': {'field': 'ps', 'unit': 'bar'},
                    },
                },
                'lv2': {'topic': 'spBv1.0/G/N/D', 'signals': {'cv': 'In/SP', 'x1': 'In/POS'}},
            },
        },
    )
    peer = Peer(domain, publishes=False)
    one = peer.listen(Measurement, '/lv1/measurement', qos.SAMPLES)
    two = peer.listen(Measurement, '/lv2/measurement', qos.SAMPLES)
    told = peer.listen(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
    assert peer.wait(lambda: told and 'nothing yet' in told[-1].status[0].message)
    plc = Program(broker.port, 'spBv1.0/G/NCMD/N')
    now = time.time_ns() // MS

    def send(n, **fields):
        body = {'ts': now + 200 * n, 'sp': 25, 'pos': {'value': 30.0}, 'p1': 35.0} | fields
        plc.publish('plant/lv1', body)

    send(0)
    send(0)  # as a broker repeats a message
    assert peer.wait(lambda: one)
    assert (one[0].cv, one[0].x1, one[0].p1) == pytest.approx((0.75, 0.7, 3.5e6))
    assert math.isnan(one[0].p2) and math.isnan(one[0].ps), 'what is left out is not measured'
    assert stamp(one[0]) == now * MS
    hostile = [b'{', b'[1]', b'[' * 100_000, b'\xff', b'{"ts": "x"}', b'{"ts": 1e300}']
    for body in [*hostile, b'{"ts": -1}', b'x' * 10_000_000]:
        plc.publish('plant/lv1', body)
    assert peer.wait(lambda: 'lv1: 10000000 bytes' in told[-1].status[0].message)
    send(1, sp='25', pos=10**400)
    assert peer.wait(lambda: len(one) == 2)
    assert math.isnan(one[1].cv) and math.isnan(one[1].x1) and one[1].p1 == 3.5e6
    send(2, p1=0, p2=0, ps=0)
    assert peer.wait(lambda: 'are exactly 0' in told[-1].status[0].message)

    born = Payload(timestamp=now, seq=1)
    for alias, name in enumerate(('In/SP', 'In/POS')):
        metric = born.metrics.add(name=name, alias=alias, timestamp=now, datatype=10)
        metric.double_value = 0.5
    data = Payload(timestamp=now + 200, seq=2)
    data.metrics.add(alias=1, timestamp=now + 200, datatype=10).double_value = 0.625
    plc.publish('spBv1.0/G/DDATA/N/D', data.SerializeToString(), 0)
    assert peer.wait(lambda: plc.of('spBv1.0/G/NCMD/N')), 'who has missed the birth asks for it'
    assert read_payload(plc.of('spBv1.0/G/NCMD/N')[0]).metrics[0].boolean_value
    plc.publish('spBv1.0/G/DBIRTH/N/D', born.SerializeToString(), 0)
    plc.publish('spBv1.0/G/DDATA/N/D', data.SerializeToString(), 0)
    assert peer.wait(lambda: any(m.x1 == 0.625 for m in two)), processes.log('mqtt').read_text()
    assert stamp(next(m for m in two if m.x1 == 0.625)) == (now + 200) * MS
    assert peer.wait(lambda: len(two) > 6), 'a device that lives holds its values'
    plc.publish('spBv1.0/G/NDEATH/N', write_payload({'bdSeq': 0}, now, None), 0)
    peer.wait(lambda: False, 0.5)
    ended = len(two)
    peer.wait(lambda: False, 1.0)
    assert len(two) == ended, 'a node that has died is silent'
    plc.close()
    peer.close()


def test_samples_in_end_with_the_broker_and_go_on_with_it(processes, domain, tmp_path, broker):
    start(
        processes,
        tmp_path,
        {
            'broker': f'mqtt://127.0.0.1:{broker.port}',
            'stamp': {'field': 'ts', 'unit': 'ms'},
            'period': 0.2,
            'valves': {'lv1': {'topic': 'plant/lv1', 'signals': {'cv': 'sp', 'x1': 'pos'}}},
        },
    )
    peer = Peer(domain, publishes=False)
    taken = peer.listen(Measurement, '/lv1/measurement', qos.SAMPLES)
    told = peer.listen(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
    assert peer.wait(lambda: told and 'nothing yet' in told[-1].status[0].message)
    plc = Program(broker.port, 'plant/lv1')
    now = time.time_ns() // MS

    def send(n):
        plc.publish('plant/lv1', {'ts': now + 200 * n, 'sp': 0.5, 'pos': 0.001 * n})

    for n in range(5):
        send(n)
    assert peer.wait(lambda: len(taken) == 5)
    broker.kill()
    assert peer.wait(lambda: told[-1].status[0].level == b'\x02'), 'told as lost'
    broker.start()
    assert peer.wait(lambda: told[-1].status[0].level != b'\x02')
    assert wait_for(plc.client.is_connected)
    for n in (3, 4, 100, 101, 102):  # a device repeats what it is not sure of
        send(n)
    assert peer.wait(lambda: len(taken) >= 8), processes.log('mqtt').read_text()
    assert [stamp(m) for m in taken] == [(now + 200 * n) * MS for n in (*range(5), 100, 101, 102)]
    assert peer.wait(lambda: told[-1].status[0].level == b'\x00')
    values = {pair.key: pair.value for pair in told[-1].status[0].values}
    assert values['Gaps'] == '1' and values['Last gap'].startswith('lv1: ')
    plc.close()
    peer.close()


def test_judgements_out_survive_the_broker_and_say_when_we_are_gone(
    processes, domain, tmp_path, broker
):
    detectors = Detectors(domain, 'lv1')
    start(
        processes,
        tmp_path,
        {
            'broker': f'mqtt://127.0.0.1:{broker.port}',
            'out': {'prefix': 'site/fd', 'sparkplug': {'group': 'G', 'node': 'fd'}},
        },
    )
    reader = Program(broker.port, 'site/fd/#', 'spBv1.0/#')
    assert wait_for(lambda: b'monitored' in reader.of('site/fd/status'))
    assert wait_for(lambda: reader.of('site/fd/lv1/state'))
    assert json.loads(reader.of('site/fd/lv1/state')[-1])['state'] == 'healthy'
    detectors.judge('lv1', FaultEvent.RAISED, 'friction up')
    assert wait_for(lambda: reader.of('site/fd/lv1/event'))
    assert wait_for(lambda: json.loads(reader.of('site/fd/lv1/state')[-1])['state'] == 'alarm')
    assert wait_for(lambda: reader.of('spBv1.0/G/DDATA/fd/lv1'))
    born = read_payload(reader.of('spBv1.0/G/DBIRTH/fd/lv1')[0])
    assert {'State', 'Fault', 'Residual'} <= {metric.name for metric in born.metrics}
    orders = [read_payload(p).seq for t, p, _ in reader.got if t.startswith('spBv1.0/G')]
    assert orders[:3] == [0, 1, 2]

    broker.kill()
    for n in range(5):
        detectors.judge('lv1', FaultEvent.CHANGED, f'change {n}')
        time.sleep(0.2)
    os.kill(processes.pid('mqtt'), signal.SIGSTOP)  # else it may be back before the reader is
    again = reader.joined + 2
    broker.start()
    assert wait_for(lambda: reader.joined >= again)
    states = len(reader.of('site/fd/lv1/state'))
    os.kill(processes.pid('mqtt'), signal.SIGCONT)
    assert wait_for(lambda: len(reader.of('site/fd/lv1/event')) >= 6)
    texts = [json.loads(each)['text'] for each in reader.of('site/fd/lv1/event')]
    assert list(dict.fromkeys(texts)) == ['friction up', *(f'change {n}' for n in range(5))]

    assert wait_for(lambda: len(reader.of('site/fd/lv1/state')) > states)  # after the events
    late = Program(broker.port, 'site/fd/#')
    assert wait_for(lambda: ('site/fd/lv1/state', True) in [(t, r) for t, _, r in late.got])
    processes.kill('mqtt')
    assert wait_for(lambda: late.of('site/fd/status')[-1:] == [b'not_monitored'])
    for each in (reader, late):
        each.close()
    detectors.close()


def test_who_was_dropped_with_nothing_to_publish_comes_back(processes, domain, tmp_path, broker):
    config = {'broker': f'mqtt://127.0.0.1:{broker.port}', 'out': {'prefix': 'fd'}}
    start(processes, tmp_path, config)
    reader = Program(broker.port, 'fd/status')
    assert wait_for(lambda: reader.of('fd/status')[-1:] == [b'monitored'])
    again = wait_for(lambda: reader.of('fd/status').count(b'monitored') >= 4)
    assert again, 'who hears nothing for two seconds may take it for gone'
    joined = reader.joined
    broker.kill()
    heard = len(reader.got)
    broker.start()
    assert wait_for(lambda: reader.joined > joined)
    assert wait_for(lambda: len(reader.got) > heard), 'it has said again that it is there'
    assert reader.of('fd/status')[-1] == b'monitored'
    broker.kill()
    log = processes.log('mqtt')
    assert wait_for(lambda: 'nobody listens' in log.read_text())
    assert 'password' not in log.read_text(), 'nobody has refused us'
    reader.close()


def test_a_wrong_password_is_told_without_it(processes, domain, tmp_path):
    (tmp_path / 'users').write_text('plant:$6$rounds=1000$abcdefgh$nothing\n')
    server = Server(tmp_path, 'mqtt_broker.py', tmp_path / 'users')
    (tmp_path / 'password').write_text('correct horse battery\n')
    user = {'name': 'plant', 'password_file': 'password'}
    start(
        processes,
        tmp_path,
        {'broker': f'mqtt://127.0.0.1:{server.port}', 'user': user, 'out': {'prefix': 'fd'}},
    )
    log = processes.log('mqtt')
    told = wait_for(lambda: 'wrong user name or password' in log.read_text())
    server.kill()
    assert told, log.read_text()
    assert 'correct horse' not in log.read_text() and 'Traceback' not in log.read_text()
