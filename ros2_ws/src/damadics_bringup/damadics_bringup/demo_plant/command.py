# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `demo_plant`: a plant behind OPC UA, a fault in one valve, and who hears of it when."""

import argparse
import asyncio
import logging
import os
import socket
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import yaml
from amqtt.broker import Broker
from asyncua import Client, ua
from damadics_connect.judgement import Transition
from damadics_connect.process import Graph
from damadics_connect.watch import Watch
from damadics_fd.ros.arguments import command_parser

from damadics_bringup.demo_plant.listeners import (
    Journal,
    again_and_again,
    conditions,
    mqtt_messages,
    server_sent_events,
    webhook,
)
from damadics_bringup.demo_plant.tags import TAGS
from damadics_bringup.processes import ProcessError, Processes, free_domain, surroundings

EXAMPLE = """example:
  make demo-plant
  ros2 run damadics_bringup demo_plant --keep      leave everything running until Ctrl-C"""
VALVES = ('lv101', 'lv102', 'lv103')
WAYS = (
    'flag (ROS 2)',
    'OPC UA condition',
    'MQTT message',
    'server-sent event',
    'notification',
)
FRICTION = 4  # of the benchmark's faults
LEARN = 30.0  # s; short, for the demonstration
PATIENCE = 150.0  # s to learn, and as long to find the fault
UNITS = {'cv': '%', 'x1': '%', 'p1': 'bar', 'p2': 'bar', 't1': 'degC', 'flow': 't/h', 'ps': 'bar'}
LIBRARIES = ('asyncua', 'amqtt', 'transitions', 'aiomqtt', 'mqtt', 'asyncio')


class Ports:
    """Free ports of this machine, one for each server."""

    def __init__(self) -> None:
        probes = [socket.socket() for _ in range(6)]
        for probe in probes:
            probe.bind(('127.0.0.1', 0))
        numbers = [probe.getsockname()[1] for probe in probes]
        self.plant, self.opcua, self.mqtt, self.http, self.page, self.webhook = numbers
        for probe in probes:
            probe.close()


def write_configurations(folder: Path, ports: Ports) -> None:
    """
    Write what a user would write: one file per connector, one fleet file.

    :param folder: takes the files.
    :param ports: of the servers.
    """
    signals = {
        tag: {
            signal: {'node': f'ns=2;s={tag.upper()}.{end}', 'unit': UNITS[signal]}
            for signal, (end, _) in TAGS.items()
        }
        for tag in VALVES
    }
    tag_of = {name: f'LV-{name[2:]}' for name in VALVES}
    settings = {'sample_rate': 50.0, 't_learn': LEARN, 'alarm_folder': ''}
    (folder / 'webhook.url').write_text(f'json://127.0.0.1:{ports.webhook}/\n')
    files = {
        'opcua': {
            'server': f'opc.tcp://127.0.0.1:{ports.plant}',
            'period': 0.02,
            'valves': {n: {'actuator': tag_of[n], 'signals': signals[n]} for n in VALVES},
            'serve': {'endpoint': f'opc.tcp://127.0.0.1:{ports.opcua}'},
        },
        'mqtt': {'broker': f'mqtt://127.0.0.1:{ports.mqtt}', 'out': {'prefix': 'damadics'}},
        'http': {'port': ports.http},
        'notify': {
            'targets': {'operators': {'url_file': 'webhook.url'}},
            'rules': [{'to': ['operators'], 'what': ['raised']}],
            'spool': 'spool.sqlite',
        },
        'fleet': {
            'valves': {n: {'settings': {'actuator': tag_of[n], **settings}} for n in VALVES}
        },
    }
    for name, content in files.items():
        (folder / f'{name}.yaml').write_text(yaml.safe_dump(content, sort_keys=False))


async def demonstrate(folder: Path, keep: bool) -> int:
    """
    Start everything, break a valve, and print who heard of it when.

    :param folder: takes configurations, logs and state.
    :param keep: leave everything running.
    :return: exit code.
    """
    began = time.monotonic()
    ports, domain = Ports(), free_domain()
    os.environ.update(surroundings(domain))
    os.environ['XDG_STATE_HOME'] = str(folder / 'state')
    write_configurations(folder, ports)
    journal = Journal()
    broker = Broker(
        {
            'listeners': {'default': {'type': 'tcp', 'bind': f'127.0.0.1:{ports.mqtt}'}},
            'plugins': {
                'amqtt.plugins.authentication.AnonymousAuthPlugin': {'allow_anonymous': True}
            },
        }
    )
    await broker.start()
    graph = Graph('demo_plant')

    def on_event(event: Transition) -> None:
        if event.transition == 'raised':
            journal.alarm(WAYS[0], event.valve)

    watch = Watch(graph.node, on_event=on_event)
    graph.start()
    tasks = [
        asyncio.ensure_future(again_and_again(listen))
        for listen in (
            lambda: conditions(ports.opcua, journal),
            lambda: mqtt_messages(ports.mqtt, journal),
            lambda: server_sent_events(ports.http, journal),
            lambda: webhook(ports.webhook, journal),
        )
    ]
    try:
        with Processes(folder / 'logs', dict(os.environ)) as processes:
            processes.start('damadics_bringup', 'opcua_plant', ['--port', str(ports.plant)])
            page = ['--dashboard', '--port', str(ports.page), '--processes', '1']
            run = [str(folder / 'fleet.yaml'), *page, '--logs', str(folder / 'logs' / 'run')]
            processes.start('damadics_bringup', 'run', run)
            for name in ('opcua', 'http', 'mqtt', 'notify'):
                processes.start('damadics_connect', name, [str(folder / f'{name}.yaml')])
            print(
                f'plant opc.tcp://127.0.0.1:{ports.plant}, judgements '
                f'opc.tcp://127.0.0.1:{ports.opcua}, HTTP http://127.0.0.1:{ports.http}/docs, '
                f'MQTT 127.0.0.1:{ports.mqtt} damadics/#, page http://127.0.0.1:{ports.page}\n'
                f'logs in {folder / "logs"}; the valves are learned for {LEARN:g} s ...',
                flush=True,
            )
            await _until(
                lambda: all(_state(watch, name) == 'healthy' for name in VALVES), processes
            )
            print(f'all three are monitored after {time.monotonic() - began:.0f} s', flush=True)
            journal.armed = True
            injected = time.time()
            async with Client(f'opc.tcp://127.0.0.1:{ports.plant}') as client:
                node = client.get_node('ns=2;s=LV103.Fault')
                await node.write_value(ua.Variant(FRICTION, ua.VariantType.Int32))
            print('friction in LV-103 ...', flush=True)
            await _until(lambda: len(journal.at) == len(WAYS), processes)
            print(table(journal, injected))
            print(f'done after {time.monotonic() - began:.0f} s', flush=True)
            if keep:
                print('everything goes on until Ctrl-C', flush=True)
                await asyncio.Event().wait()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        graph.stop()
        await broker.shutdown()
    return 0


def table(journal: Journal, injected: float) -> str:
    """
    Write who heard when.

    :param journal: what was heard.
    :param injected: when the fault was put in [s since 1970].
    :return: lines of text.
    """
    first = journal.at[WAYS[0]]
    lines = [f'{"told as":<20} {"at (UTC)":<14} {"after fault":>12} {"after flag":>11}']
    for way in WAYS:
        at = journal.at[way]
        clock = time.strftime('%H:%M:%S', time.gmtime(at)) + f'.{at % 1 * 1000:03.0f}'
        lines.append(f'{way:<20} {clock:<14} {at - injected:>10.2f} s {at - first:>9.3f} s')
    return '\n'.join(lines)


def _state(watch: Watch, name: str) -> str:
    judgement = watch.valves.get(name)
    return judgement.state if judgement else ''


async def _until(condition, processes: Processes) -> None:  # type: ignore[no-untyped-def]
    deadline = time.monotonic() + PATIENCE
    while not condition():
        processes.check()
        if time.monotonic() > deadline:
            raise ProcessError(f'not within {PATIENCE:g} s: is this machine busy? See the logs')
        await asyncio.sleep(0.02)


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser(
        'demo_plant', 'A simulated plant behind OPC UA: from a fault to everybody told.', EXAMPLE
    )
    p.add_argument('--keep', action='store_true', help='leave everything running until Ctrl-C')
    p.add_argument('--out', type=Path, metavar='DIR', help='configurations and logs (temporary)')
    return p


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    options = parser().parse_args(args)
    for name in LIBRARIES:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    folder = options.out or Path(tempfile.mkdtemp(prefix='damadics-demo-plant-'))
    folder.mkdir(parents=True, exist_ok=True)
    try:
        return asyncio.run(demonstrate(folder.resolve(), options.keep))
    except KeyboardInterrupt:
        return 0
    except (ProcessError, OSError) as problem:
        print(f'demo_plant: {problem} ({folder / "logs"})', file=sys.stderr)
        return 1


if __name__ == '__main__':
    sys.exit(main())
