# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""MQTT over TLS: our authority opens the channel, another broker's certificate does not."""

import asyncio

import pytest
from aiomqtt import MqttError
from connect.certificates import make_certificate
from connect.servers import Server
from damadics_connect.mqtt.broker import read_broker, why
from damadics_connect.settings import read_config

CONFIG = """broker: mqtts://localhost:{port}
tls: {{ca: {authority}}}
"""


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp('tls')
    for name in ('broker', 'another'):
        make_certificate(folder, name, f'urn:{name}')
    return folder


@pytest.fixture(scope='module')
def broker(folder):
    broker = Server(folder, 'mqtt_broker.py', folder / 'broker.crt', folder / 'broker.pem')
    yield broker
    broker.kill()


async def said_and_heard(folder, broker, authority: str) -> bytes:
    file = folder / 'mqtt.yaml'
    file.write_text(CONFIG.format(port=broker.port, authority=authority))
    async with read_broker(read_config(file)).client() as client:
        await client.subscribe('plant/#')
        await client.publish('plant/lv1', b'0.5', qos=1)
        async with asyncio.timeout(10.0):
            async for message in client.messages:
                return message.payload
    return b''


def test_an_encrypted_broker_is_talked_to(folder, broker):
    assert asyncio.run(said_and_heard(folder, broker, 'broker.crt')) == b'0.5'


def test_a_broker_with_the_certificate_of_another_is_not(folder, broker):
    with pytest.raises(MqttError) as refused:
        asyncio.run(said_and_heard(folder, broker, 'another.crt'))
    assert 'the certificate of the broker is refused' in why(refused.value)
