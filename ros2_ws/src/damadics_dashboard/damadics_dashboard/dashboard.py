# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `dashboard`: the web page, live from ROS 2 topics."""

import argparse
import asyncio
import os
import signal
import sys
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from damadics_fd.causes import CauseTableError
from damadics_fd.ros.arguments import command_parser, split_ros_args, state_folder
from damadics_fd.store.access import Access, AccessError, parse_access, read_access
from damadics_fd.store.alarms import default_folder

from damadics_dashboard.server.access import Guard, check_binding
from damadics_dashboard.words.texts import use_causes

if TYPE_CHECKING:
    from damadics_dashboard.live.watcher import Watcher

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
    p.add_argument('--port', type=_port, default=8080, help='port to serve on (8080)')
    p.add_argument(
        '--token-file',
        type=Path,
        metavar='FILE',
        help='file with the tokens that other machines must show, a line each: operator TOKEN '
        'NAME, or viewer TOKEN NAME; or set DAMADICS_DASHBOARD_TOKEN',
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
    p.add_argument(
        '--signatures',
        type=Path,
        action='append',
        default=[default_folder()],
        metavar='DIR',
        help='signature_folder of detectors, beside "auto": the trends that they kept while there '
        'was no page are taken over; again for more',
    )
    p.add_argument(
        '--causes',
        type=Path,
        metavar='FILE',
        help='causes.yaml with your own texts and advice, as causes_file of the detectors',
    )
    p.add_argument('--show', action='store_true', help='open the page in a browser')
    return p


def _port(text: str) -> int:
    """Read a port."""
    number = int(text) if text.isdigit() else 0
    if not 0 < number < 65536:
        raise argparse.ArgumentTypeError(f'{text} is no port: give a number from 1 to 65535')
    return number


def read_tokens(path: Path | None) -> Access:
    """
    Read the tokens.

    :param path: of their file; otherwise the environment has one.
    :return: what each of them allows; nothing where nobody needs one.
    :raises AccessError: where the file cannot be read, is empty or has a bad token.
    """
    if path is not None:
        return read_access(path)
    token = os.environ.get('DAMADICS_DASHBOARD_TOKEN', '').strip()
    return parse_access([token], 'DAMADICS_DASHBOARD_TOKEN') if token else Access()


def main(args: list[str] | None = None) -> int:
    """
    Serve the page until a signal comes.

    :param args: command line, `sys.argv` by default; what follows `--ros-args` is for ROS 2.
    :return: exit code.
    """
    words, ros_args = split_ros_args(args)
    options = parser().parse_args(words)
    try:
        access = read_tokens(options.token_file)
        check_binding(options.host, access)
        use_causes(options.causes)
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        return serve(options, access, ros_args)
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        return 0  # the server repeats the signal after its clean end
    except (AccessError, CauseTableError) as problem:
        print(f'dashboard: {problem}', file=sys.stderr)
        return 2
    except OSError as problem:
        print(f'dashboard: {problem}; give another --port, --state or --causes', file=sys.stderr)
        return 2


def serve(options: argparse.Namespace, access: Access, ros_args: list[str]) -> int:
    """
    Serve the page.

    :param options: the command line.
    :param access: the tokens that are accepted.
    :param ros_args: arguments of ROS 2, such as its enclave.
    :return: exit code: 1 where the ROS side failed.
    """
    _check_port(options.host, options.port)
    # after the check of the arguments, for they take a second
    from damadics_fd.store.intervals import Intervals
    from damadics_fd.web.limits import PatientProtocol, SizeLimit
    from nicegui import app, ui

    from damadics_dashboard.live.trend_points import TrendPoints
    from damadics_dashboard.live.watcher import Watcher
    from damadics_dashboard.pages.frame import FAVICON
    from damadics_dashboard.pages.routes import add_routes
    from damadics_dashboard.server.log import keep_short
    from damadics_dashboard.store.history import History

    keep_short()
    history = History(options.state / 'history.sqlite')
    trends = TrendPoints(Intervals(options.state / 'trends.sqlite'), options.signatures)
    watcher = Watcher(history, trends, options.follow, ros_args)
    app.add_static_files('/assets', str(HERE / 'static'))
    app.add_middleware(SizeLimit)
    app.add_middleware(Guard, access=access)
    add_routes(watcher)
    app.on_startup(_take_one_signal)
    app.on_startup(watcher.start)
    app.on_shutdown(watcher.stop)
    app.on_shutdown(trends.close)
    app.on_shutdown(history.close)
    app.on_startup(lambda: _end_with(watcher))
    shown = f'[{options.host}]' if ':' in options.host else options.host
    app.on_startup(
        lambda: print(
            f'The dashboard is at http://{shown}:{options.port}'
            + ('' if access.open else '/?token=...'),
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
        http=PatientProtocol,
    )
    return 0 if watcher.failure is None else 1


async def _end_with(watcher: 'Watcher') -> None:
    """End this process where its ROS side has ended, so that `run` starts it again."""
    from nicegui import app, background_tasks

    async def watch() -> None:
        while watcher.failure is None:
            await asyncio.sleep(0.5)
        print(f'dashboard: ROS 2 side failed: {watcher.failure!r}', file=sys.stderr, flush=True)
        app.shutdown()

    background_tasks.create(watch(), name='watch the ROS side')


def _take_one_signal() -> None:
    """Ignore a second signal, which launch sends: the server would not leave the graph then."""
    both = (signal.SIGINT, signal.SIGTERM)
    of_server = {number: signal.getsignal(number) for number in both}

    def end(number: int, frame: FrameType | None) -> None:
        for other in both:
            signal.signal(other, signal.SIG_IGN)
        handler = of_server[signal.Signals(number)]
        if callable(handler):
            handler(number, frame)

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
