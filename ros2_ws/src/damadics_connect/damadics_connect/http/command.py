# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `http`: JSON, server-sent events, actions and metrics for programs and browsers."""

import argparse
import asyncio
import contextlib
import socket
import sys
from collections.abc import Sequence
from pathlib import Path

from damadics_fd.ros.arguments import command_parser, split_ros_args

from damadics_connect.process import ConnectError, Graph, run
from damadics_connect.settings import check, read_config

EXAMPLES = """example:
  ros2 run damadics_connect http http.yaml
with http.yaml:
  host: 127.0.0.1
  port: 8090
  token_file: tokens        # lines "operator TOKEN NAME" and "viewer TOKEN NAME"
then http://127.0.0.1:8090/docs lists what can be asked for."""
MISSING = 'fastapi, uvicorn and prometheus-client are needed: make env'


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser(
        'http', 'Serve judgements as JSON, server-sent events and Prometheus metrics.', EXAMPLES
    )
    p.add_argument('config', type=Path, metavar='CONFIG.yaml', help='address, port and tokens')
    return p


async def serve(path: Path, ros_args: list[str]) -> int:
    """
    Serve until cancelled.

    :param path: the configuration.
    :param ros_args: arguments of ROS 2.
    :return: exit code.
    """
    try:
        import uvicorn
        from damadics_fd.web.limits import PatientProtocol

        from damadics_connect.http.api import application
        from damadics_connect.http.guard import read_guard
    except ModuleNotFoundError as problem:
        raise ConnectError(MISSING) from problem
    from damadics_connect.actions import Actions
    from damadics_connect.http.stream import Stream
    from damadics_connect.watch import Watch

    config = read_config(path)
    host = config.text('host', '127.0.0.1')
    port = int(config.number('port', 8090, 1, 65535))
    guard = read_guard(config, host)
    check(config, path)
    listener = _listen(host, port)
    graph = Graph('http', ros_args)
    try:
        watch = Watch(graph.node)
        stream = Stream(asyncio.get_running_loop(), watch.valves)
        watch.tell(stream.state, stream.event)
        app = application(watch, Actions(graph.node, watch), stream, guard)
        graph.start()
        server = uvicorn.Server(
            uvicorn.Config(
                app,
                log_level='error',
                access_log=False,
                timeout_graceful_shutdown=1,
                server_header=False,
                http=PatientProtocol,
            )
        )
        server.install_signal_handlers = lambda: None  # type: ignore[attr-defined]
        server.capture_signals = contextlib.nullcontext  # type: ignore[assignment]
        graph.node.get_logger().info(f'serving http://{host}:{port}/docs')
        task = asyncio.ensure_future(server.serve(sockets=[listener]))
        try:
            await asyncio.shield(task)
        except asyncio.CancelledError:
            server.should_exit = True
            stream.close()
            await task
            raise
    finally:
        graph.stop()
    return 0


def _listen(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ':' in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
    except OSError as problem:
        listener.close()
        raise ConnectError(
            f'cannot serve on {host}:{port}: {problem.strerror}; give another host or port'
        ) from None
    return listener


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    words, ros_args = split_ros_args(args)
    options = parser().parse_args(words)
    return run('http', lambda: serve(options.config, ros_args))


if __name__ == '__main__':
    sys.exit(main())
