# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `dashboard`: the web page, live from ROS 2 topics."""

import argparse
import os
import signal
import sys
from pathlib import Path
from typing import Any

from damadics_fd.ros.arguments import command_parser, split_ros_args, state_folder

from damadics_dashboard.access import AccessError, Guard, check_binding

HERE = Path(__file__).parent
EXAMPLE = """example:
  ros2 run damadics_dashboard dashboard
then open http://127.0.0.1:8080
"""


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser(
        'dashboard',
        'Web page for the people at the plant: every valve, its alarms, its signals.',
        EXAMPLE,
    )
    p.add_argument('--host', default='127.0.0.1', help='address to serve on (127.0.0.1)')
    p.add_argument('--port', type=int, default=8080, help='port to serve on (8080)')
    p.add_argument(
        '--token-file',
        type=Path,
        metavar='FILE',
        help='file with the token that other machines must show; or set DAMADICS_DASHBOARD_TOKEN',
    )
    p.add_argument(
        '--state',
        type=Path,
        metavar='DIR',
        default=state_folder(),
        help='where the alarm history is kept (%(default)s)',
    )
    p.add_argument(
        '--follow',
        type=int,
        default=16,
        metavar='N',
        help='take all samples of all valves in fleets up to N, otherwise only of '
        'those that are looked at (16)',
    )
    p.add_argument('--show', action='store_true', help='open the page in a browser')
    return p


def read_token(path: Path | None) -> str:
    """
    Read the token.

    :param path: of its file; otherwise the environment has it.
    :return: the token, '' for none.
    :raises AccessError: where the file cannot be read or is empty.
    """
    if path is None:
        return os.environ.get('DAMADICS_DASHBOARD_TOKEN', '').strip()
    try:
        token = path.read_text().strip()
    except OSError as problem:
        raise AccessError(f'--token-file {path}: {problem.strerror}') from problem
    if not token:
        raise AccessError(f'--token-file {path} is empty: openssl rand -hex 16 > {path}')
    return token


def main(args: list[str] | None = None) -> int:
    """
    Serve the page until a signal comes.

    :param args: command line, `sys.argv` by default; what follows `--ros-args` is for ROS 2.
    :return: exit code.
    """
    words, ros_args = split_ros_args(args)
    options = parser().parse_args(words)
    try:
        token = read_token(options.token_file)
        check_binding(options.host, token)
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        serve(options, token, ros_args)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        return 0  # the server repeats the signal after its clean end
    except AccessError as problem:
        print(f'dashboard: {problem}', file=sys.stderr)
        return 1
    except OSError as problem:
        print(f'dashboard: {problem}; give another --port or --state', file=sys.stderr)
        return 1
    return 0


def serve(options: argparse.Namespace, token: str, ros_args: list[str]) -> None:
    """
    Serve the page.

    :param options: the command line.
    :param token: the token, '' for none.
    :param ros_args: arguments of ROS 2, such as its enclave.
    """
    _check_port(options.host, options.port)
    # after the check of the arguments, for they take a second
    from nicegui import app, ui

    from damadics_dashboard.fleet_page import fleet_page, history_page
    from damadics_dashboard.frame import FAVICON
    from damadics_dashboard.history import History
    from damadics_dashboard.replay_page import replay_page
    from damadics_dashboard.valve_page import valve_page
    from damadics_dashboard.watcher import Watcher

    history = History(options.state / 'history.sqlite')
    watcher = Watcher(history, options.follow, ros_args)
    app.add_static_files('/assets', str(HERE / 'static'))
    app.add_middleware(Guard, token=token)
    ui.page('/')(lambda: fleet_page(watcher))
    ui.page('/history')(lambda: history_page(watcher))

    ui.page('/replay')(lambda: replay_page(watcher))

    @ui.page('/valve/{name}')
    def valve(name: str) -> None:
        valve_page(watcher, name)

    app.on_startup(_take_one_signal)
    app.on_startup(watcher.start)
    app.on_shutdown(watcher.stop)
    app.on_shutdown(history.close)
    shown = f'[{options.host}]' if ':' in options.host else options.host
    app.on_startup(
        lambda: print(
            f'The dashboard is at http://{shown}:{options.port}'
            + ('/?token=...' if token else ''),
            flush=True,
        )
    )
    ui.run(
        host=options.host,
        port=options.port,
        title='DAMADICS FD',
        favicon=FAVICON,
        dark=None,
        show=options.show,
        reload=False,
        show_welcome_message=False,
        language='en-US',
        tailwind=False,
        unocss=None,
        uvicorn_logging_level='warning',
        reconnect_timeout=10.0,
    )


def _take_one_signal() -> None:
    """Ignore a second signal, which launch sends: the server would not leave the graph then."""
    both = (signal.SIGINT, signal.SIGTERM)
    of_server = {number: signal.getsignal(number) for number in both}

    def end(number: int, frame: Any) -> None:
        for other in both:
            signal.signal(other, signal.SIG_IGN)
        of_server[number](number, frame)

    for number in both:
        signal.signal(number, end)


def _check_port(host: str, port: int) -> None:
    """Make sure that the port is free; the server itself would only log."""
    import socket

    family = socket.AF_INET6 if ':' in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as problem:
            raise OSError(f'cannot serve on {host}:{port}: {problem.strerror}') from problem


if __name__ == '__main__':
    sys.exit(main())
