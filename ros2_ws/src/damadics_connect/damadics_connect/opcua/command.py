# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `opcua`: signals from an OPC UA server, judgements to OPC UA clients."""

import argparse
import asyncio
import sys
from collections.abc import Sequence
from pathlib import Path

from damadics_fd.ros.arguments import command_parser, split_ros_args, state_folder

from damadics_connect.addresses import address_problem, shown
from damadics_connect.process import ConnectError, Graph, run
from damadics_connect.settings import ConfigError, check, read_config

EXAMPLES = """examples:
  ros2 run damadics_connect opcua --browse opc.tcp://plc:4840 > plant.yaml
  ros2 run damadics_connect opcua plant.yaml"""
LIBRARIES = ('asyncua', 'asyncio')
MISSING = 'asyncua is not installed: pip install asyncua==2.1.0 (or make env)'


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser(
        'opcua',
        'Take signals from an OPC UA server, and serve judgements to OPC UA clients.',
        EXAMPLES,
    )
    p.add_argument('config', nargs='?', type=Path, metavar='CONFIG.yaml', help='what to connect')
    p.add_argument(
        '--browse',
        metavar='URL',
        help='list the nodes of a server and propose a configuration; with CONFIG.yaml its '
        'user and security are used',
    )
    return p


async def connect(path: Path, ros_args: list[str]) -> int:
    """
    Connect what a configuration names.

    :param path: the configuration.
    :param ros_args: arguments of ROS 2.
    :return: exit code.
    """
    from damadics_connect.opcua.cycles import Cycles
    from damadics_connect.opcua.feed import Options
    from damadics_connect.opcua.server import Judgements, read_serve
    from damadics_connect.opcua.session import read_endpoint
    from damadics_connect.opcua.source import Source
    from damadics_connect.opcua.wire import keep_bytes
    from damadics_connect.opcua.written.nodes import read_plant_nodes
    from damadics_connect.opcua.written.writer import PlantWriter
    from damadics_connect.publishing import Output, output_of
    from damadics_connect.valve_list import read_valves

    config = read_config(path)
    needed = 'serve' not in config or 'write' in config
    endpoint = read_endpoint(config) if 'server' in config or needed else None
    valves = read_valves(config, 'node')
    options = Options(
        config.number('publishing_interval', 0.0, 0.005, 60.0),
        int(config.number('queue', 0, 1, 100_000)),
        config.flag('poll'),
    )
    publish = config.text('publish', 'topics', choices=('topics', 'blocks'))
    serve = read_serve(config)
    written = read_plant_nodes(config, valves)
    if endpoint is not None and not valves and not written:
        config.problems.append('valves: name at least one; opcua --browse URL proposes some')
    check(config, path)
    graph = Graph('opcua', ros_args)
    log = graph.node.get_logger().info
    names = [valve.known_as for valve in valves]
    jobs = []
    cycles = None
    try:
        if endpoint is not None and written:
            writer = PlantWriter(endpoint, written, graph.node, log)
            graph.tell_health('OPC UA out', writer.report)
            jobs.append(writer.run())
        if endpoint is not None and valves:
            keep_bytes()
            output: Output = output_of(publish, graph.node, names)
            if serve is not None:
                output = cycles = Cycles(output, names, state_folder() / 'cycles.json')
            source = Source(endpoint, valves, options, output, log)
            graph.tell_health('OPC UA', source.report)
            jobs.append(source.run())
        if serve is not None:
            counts = cycles.counts if cycles else {}
            jobs.append(Judgements(serve, graph.node, counts, log).run())
        graph.start()
        await asyncio.gather(*jobs)
    finally:
        graph.stop()
        if cycles is not None:
            cycles.save()
    return 0


async def browse(url: str, path: Path | None) -> int:
    """
    List a server's nodes and propose a configuration.

    :param url: of the server.
    :param path: a configuration with user and security; None for neither.
    :return: exit code.
    """
    from asyncua import ua

    from damadics_connect.opcua.browse import propose
    from damadics_connect.opcua.session import (
        Endpoint,
        SessionError,
        close_session,
        open_session,
        read_endpoint,
        why,
    )

    if problem := address_problem(url, 'opc.tcp'):
        raise ConnectError(f'--browse: the address {problem} (in a CONFIG.yaml after it)')
    endpoint = Endpoint(url)
    if path is not None:
        config = read_config(path)
        endpoint = read_endpoint(config)._replace(url=url)
        if config.problems:
            raise ConfigError('\n  '.join([f'{path}:', *config.problems]))
    try:
        client = await open_session(endpoint)
        try:
            print(await propose(client, url))
        finally:
            await close_session(client)
    except SessionError as problem:
        raise ConnectError(str(problem)) from None
    except (ua.UaError, OSError, TimeoutError) as problem:
        raise ConnectError(f'{shown(url)}: {why(problem)}') from None
    return 0


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    words, ros_args = split_ros_args(args)
    p = parser()
    options = p.parse_args(words)
    if not options.config and not options.browse:
        p.error('give a CONFIG.yaml, or --browse URL to have one proposed')

    async def work() -> int:
        try:
            if options.browse:
                return await browse(options.browse, options.config)
            return await connect(options.config, ros_args)
        except ModuleNotFoundError as problem:
            if (problem.name or '').partition('.')[0] != 'asyncua':
                raise
            raise ConnectError(MISSING) from None

    return run('opcua', work, LIBRARIES)


if __name__ == '__main__':
    sys.exit(main())
