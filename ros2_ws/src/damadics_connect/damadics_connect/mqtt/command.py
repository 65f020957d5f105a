# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `mqtt`: samples from a broker, judgements to it."""

import argparse
import asyncio
import sys
from collections.abc import Coroutine, Sequence
from pathlib import Path

from damadics_fd.ros.arguments import command_parser, split_ros_args

from damadics_connect.process import ConnectError, Graph, run
from damadics_connect.settings import Section, check, read_config

EXAMPLES = """example:
  ros2 run damadics_connect mqtt mqtt.yaml
with mqtt.yaml:
  broker: mqtt://broker:1883
  out: {prefix: damadics}
  stamp: {field: ts, unit: ms}
  valves:
    lv101:
      topic: plant/lv101                     # JSON: {"ts": ..., "SP": 52.1, "POS": 51.9}
      signals: {cv: {field: SP, unit: '%'}, x1: {field: POS, unit: '%'}}
    lv102:
      topic: spBv1.0/GROUP/NODE/DEVICE       # Sparkplug B; fields are names of metrics
      signals: {cv: SP, x1: POS}"""
MISSING = 'aiomqtt and protobuf are needed: make env'
LIBRARIES = ('mqtt', 'aiomqtt')


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser(
        'mqtt', 'Take samples from an MQTT broker and publish judgements to it.', EXAMPLES
    )
    p.add_argument('config', type=Path, metavar='CONFIG.yaml', help='what to connect')
    return p


async def connect(path: Path, ros_args: list[str]) -> int:
    """
    Connect what a configuration names.

    :param path: the configuration.
    :param ros_args: arguments of ROS 2.
    :return: exit code.
    """
    try:
        from damadics_connect.mqtt.broker import read_broker
        from damadics_connect.mqtt.edge_node import EdgeNode
        from damadics_connect.mqtt.incoming import Incoming
        from damadics_connect.mqtt.json_sample import UNITS
        from damadics_connect.mqtt.outgoing import Outgoing
    except ModuleNotFoundError as problem:
        raise ConnectError(MISSING) from problem
    from damadics_connect.publishing import output_of
    from damadics_connect.valve_list import read_valves
    from damadics_connect.watch import Watch

    config = read_config(path)
    broker = read_broker(config)
    valves = read_valves(config, 'field', place='topic')
    stamp = config.section('stamp')
    field = stamp.text('field', 'stamp'), stamp.text('unit', 'ns', choices=(*UNITS, 'iso'))
    stamp.done()
    publish = config.text('publish', 'topics', choices=('topics', 'blocks'))
    for valve in valves:
        _check_topic(config, valve.name, valve.place)
    out, prefix, edge = _read_out(config)
    if not valves and not out:
        config.problems.append('give valves (samples in), out (judgements out) or both')
    check(config, path)
    graph = Graph('mqtt', ros_args)
    log = graph.node.get_logger().info
    jobs: list[Coroutine[None, None, None]] = []
    try:
        if valves:
            output = output_of(publish, graph.node, [valve.known_as for valve in valves])
            incoming = Incoming(broker, valves, field, output, log)
            graph.tell_health('MQTT', incoming.report)
            jobs.append(incoming.run())
        if out:
            watch = Watch(graph.node)
            outgoing = Outgoing(broker, prefix, watch.valves, log)
            watch.tell(outgoing.state, outgoing.event)
            jobs.append(outgoing.run())
            if edge:
                jobs.append(EdgeNode(broker, *edge, watch.valves, log).run())
        graph.start()
        await asyncio.gather(*jobs)
    finally:
        graph.stop()
    return 0


def _check_topic(config: Section, valve: str, topic: str) -> None:
    if not topic or set(topic) & set('+#'):
        config.problems.append(f'valves.{valve}.topic: give one topic, without + and #')
    elif topic.startswith('spBv1.0/') and topic.count('/') != 3:
        config.problems.append(f'valves.{valve}.topic: write spBv1.0/GROUP/NODE/DEVICE')


def _read_out(config: Section) -> tuple[bool, str, tuple[str, str] | None]:
    out = config.section('out')
    prefix = out.text('prefix', 'damadics').strip('/')
    if not prefix or set(prefix) & set('+#$'):
        out.refuse('prefix', 'is no beginning of a topic: such as damadics')
    sparkplug = out.section('sparkplug')
    edge = None
    if 'sparkplug' in out:
        edge = sparkplug.needed('group', 'plant'), sparkplug.needed('node', 'damadics')
        if any(set(part) & set('+#/') for part in edge):
            out.refuse('sparkplug', 'has +, # or / in a name')
    sparkplug.done()
    out.done()
    return 'out' in config, prefix, edge


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    words, ros_args = split_ros_args(args)
    options = parser().parse_args(words)
    return run('mqtt', lambda: connect(options.config, ros_args), LIBRARIES)


if __name__ == '__main__':
    sys.exit(main())
