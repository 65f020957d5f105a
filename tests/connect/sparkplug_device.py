# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
A Sparkplug B device at rest, and one who listens to it: `sparkplug_device.py PORT [listen]`.

The device tells its values when it is born and nothing afterwards; it is born when it is connected
and when somebody asks for it. Who listens prints a line for each sample that the connector
publishes, with the time at which it did, and one for each thing that it tells a person.
"""

import asyncio
import sys
import time

import paho.mqtt.client as paho
from damadics_connect.mqtt.broker import Broker
from damadics_connect.mqtt.incoming import Incoming
from damadics_connect.mqtt.sparkplug import write_payload
from damadics_connect.settings import Secret
from damadics_connect.valve_list import Signal, ValveSource
from damadics_fd.bag.mapping import Scale

EDGE = 'spBv1.0/G/{}/N'
PERIOD = 0.5  # s


class Print:
    """Prints samples."""

    samples = 0
    zero: frozenset[str] = frozenset()

    def send(self, valve: int, stamp: int, values: list[float]) -> None:
        self.samples += 1
        print(f'{time.time():.3f} sample {stamp} {values[0]:g}', flush=True)

    def flush(self) -> None:
        """Do nothing: every line has gone."""


def device(port: int) -> None:
    """Be the device for ever."""

    def born(client, *_) -> None:
        client.subscribe(EDGE.format('NCMD'), 1)
        now = time.time_ns() // 1_000_000
        client.publish(EDGE.format('NBIRTH'), write_payload({'bdSeq': 0}, now, 0), 1)
        values = {'SP': 0.25, 'POS': 0.5}
        client.publish(f'{EDGE.format("DBIRTH")}/D', write_payload(values, now, 1), 1)

    client = paho.Client(paho.CallbackAPIVersion.VERSION2)
    client.on_connect = client.on_message = born
    client.will_set(EDGE.format('NDEATH'), write_payload({'bdSeq': 0}, 0, None), 1)
    client.reconnect_delay_set(1, 1)
    client.connect('127.0.0.1', port, 2)
    client.loop_forever()


async def listen(port: int) -> None:
    """Be the connector's side of it for ever."""
    broker = Broker('127.0.0.1', port, '', Secret(), False, None)
    signals = (Signal(0, 'SP', Scale()), Signal(1, 'POS', Scale()))
    valve = ValveSource('lv1', 'LV-1', PERIOD, signals, 'spBv1.0/G/N/D')
    log = lambda text: print(f'{time.time():.3f} told {text}', flush=True)  # noqa: E731
    await Incoming(broker, [valve], ('ts', 'ms'), Print(), log).run()


if __name__ == '__main__':
    number = int(sys.argv[1])
    if sys.argv[2:]:
        asyncio.run(listen(number))
    device(number)
