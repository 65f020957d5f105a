# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `recorder`: topics, raw, into a crash-safe MCAP bag."""

import argparse
import signal
import sys
import time
from pathlib import Path

import rclpy
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.writing.bag_writer import BagWriter
from damadics_fd.bag.writing.blackbox import BlackBox
from damadics_fd.bag.writing.spool import Spool
from damadics_fd.nodes.recorder import Recorder
from damadics_fd.ros.arguments import command_parser, suggestion
from damadics_fd.ros.spin import spin_until, take_what_is_on_its_way


def _arguments(args: list[str]) -> argparse.Namespace:
    parser = command_parser(
        'recorder',
        'Record topics into an MCAP bag until SIGINT or SIGTERM.',
        'example: ros2 run damadics_fd recorder measurement fault_flag --out bags/monday',
    )
    parser.add_argument('topics', nargs='*', help='topics to record; none means all')
    parser.add_argument('--all', action='store_true', help='record all topics')
    parser.add_argument(
        '--out',
        type=Path,
        help='bag directory to create, or a single .mcap file'
        ' (default: rosbag2_ and the time of day)',
    )
    parser.add_argument('--split-mb', type=float, default=0, help='new file every so many MB')
    parser.add_argument('--split-s', type=float, default=0, help='new file every so many seconds')
    parser.add_argument(
        '--quota-mb',
        type=float,
        default=0,
        help='keep the bag below so many MB by removing its oldest files',
    )
    parser.add_argument(
        '--black-box',
        nargs=2,
        type=float,
        metavar=('BEFORE', 'AFTER'),
        help='hold the last BEFORE seconds in memory; write a bag when a fault is flagged, until'
        ' AFTER seconds later',
    )
    options = parser.parse_args(args)
    if options.all and options.topics:
        parser.error('give topics or --all, not both')
    splitting = (options.split_mb, options.split_s, options.quota_mb)
    if min(splitting) < 0 or min(options.black_box or [0]) < 0:
        parser.error('sizes and times must not be negative')
    if options.black_box and any(splitting):
        parser.error('--black-box writes one bag per fault: no split, no quota')
    options.out = options.out or Path(time.strftime('rosbag2_%Y_%m_%d-%H_%M_%S'))
    return options


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    arguments = sys.argv if args is None else ['recorder', *args]
    options = _arguments(remove_ros_args(arguments)[1:])
    stop: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda signum, frame: stop.append(signum))
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    node: Recorder | None = None
    try:
        bag = _bag(options)
        spool = Spool(bag, rotate=options.quota_mb > 0)
        node = Recorder(spool, options.topics)
        topics = ' '.join(node.topics) or f'{" ".join(sorted(node.wanted))} (nobody sends it yet)'
        print(f'recording {topics} into {bag.path}', flush=True)
        _spin(node, spool, stop)
        node.look()
        seen = [name for name, _ in node.get_topic_names_and_types() if name not in node.wanted]
        spool.close()
    except (BagError, OSError) as error:
        print(f'recorder: {error}', file=sys.stderr)
        return 1
    finally:
        if node:
            node.destroy_node()
        rclpy.try_shutdown()
    lost = ''.join(
        f', {count} {what}'
        for count, what in (
            (sum(node.lost.values()), 'lost on the way'),
            (spool.dropped, 'dropped'),
            (bag.missed if isinstance(bag, BlackBox) else 0, 'faults without a bag'),
        )
        if count
    )
    print(f'recorded {spool.written} messages{lost}, {bag.size} bytes: {bag.path}')
    if spool.error:
        print(f'recorder: cannot write: {spool.error}', file=sys.stderr)
    silent = [name for name in node.wanted if not bag.counts.get(name)]
    for name in sorted(silent):
        hint = suggestion(name, seen)
        said = f'recorder: no message came on {name}'
        print(f'{said}: {hint}' if hint else said, file=sys.stderr)
    return int(bool(spool.dropped or spool.error))


def _bag(options: argparse.Namespace) -> BagWriter | BlackBox:
    if options.black_box:
        return BlackBox(options.out, *options.black_box)
    return BagWriter(
        options.out,
        split_bytes=int(options.split_mb * 1e6),
        split_seconds=options.split_s,
        quota_bytes=int(options.quota_mb * 1e6),
    )


def _spin(node: Recorder, spool: Spool, stop: list[int]) -> None:
    """Receive until a signal comes, then what is still on its way."""
    executor = EventsExecutor()
    executor.add_node(node)
    spin_until(lambda: bool(stop), executor, [node])
    take_what_is_on_its_way(executor, lambda: spool.received, lambda: node.newest)


if __name__ == '__main__':
    sys.exit(main())
