# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `notify`: tell people by e-mail, chat and webhooks."""

import argparse
import asyncio
import sys
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from damadics_fd.core.stamps import is_date
from damadics_fd.ros.arguments import command_parser, split_ros_args, state_folder

from damadics_connect.process import ConnectError, Graph, run
from damadics_connect.settings import check, read_config

EXAMPLES = """example:
  ros2 run damadics_connect notify notify.yaml --test      one message to every target
  ros2 run damadics_connect notify notify.yaml
with notify.yaml:
  targets:
    shift: {url_file: shift.url}           # an address of apprise, such as mailtos://...
    chat: {url_env: CHAT_URL}
  rules:
    - {to: [shift], classes: [failure], debounce: 10}
    - {to: [chat], valves: ['lv1*'], from: '06:00', until: '22:00', digest: 300}"""
MISSING = 'apprise is not installed: make env'
OLD = 600.0  # s: transitions before the very first start are told only if they are newer
LIBRARIES = ('apprise', 'urllib3', 'requests', 'asyncio')


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser('notify', 'Tell people of alarms by e-mail, chat and webhooks.', EXAMPLES)
    p.add_argument('config', type=Path, metavar='CONFIG.yaml', help='targets and rules')
    p.add_argument('--test', action='store_true', help='send one message to every target and end')
    return p


async def notify(path: Path, test: bool, ros_args: list[str]) -> int:
    """
    Tell people until cancelled.

    :param path: the configuration.
    :param test: only send a test message.
    :param ros_args: arguments of ROS 2.
    :return: exit code.
    """
    try:
        from damadics_connect.notify.delivery import Delivery, read_targets, send
    except ModuleNotFoundError as problem:
        raise ConnectError(MISSING) from problem
    from damadics_fd.ros.diagnostics import Level, Report

    from damadics_connect.judgement import Judgement, Transition
    from damadics_connect.notify.rules import (
        Desk,
        Message,
        News,
        news_of_event,
        news_of_silence,
        read_rules,
    )
    from damadics_connect.notify.spool import Spool
    from damadics_connect.watch import Watch

    config = read_config(path)
    targets = read_targets(config)
    rules = read_rules(config, targets)
    spool_path = config.path('spool', must_exist=False) or state_folder() / 'notify.sqlite'
    check(config, path)
    if test:
        failed = 0
        for name, address in targets.items():
            words = 'This is a test of your rules; no valve is concerned.'
            done = await send(address, Message(name, '[DAMADICS FD] test', words))
            failed += not done
            print(f'{name}: {"delivered" if done else "NOT delivered: address or network?"}')
        return 1 if failed else 0
    spool = Spool(spool_path)
    began = time.time_ns()
    loop = asyncio.get_running_loop()
    graph = Graph('notify', ros_args)
    log = graph.node.get_logger().info
    desk = Desk(rules, spool.put)
    delivery = Delivery(targets, spool, log)
    watch = Watch(graph.node)
    monitored: set[str] = set()

    def take(news: News) -> None:
        desk.take(news, time.monotonic(), datetime.now())

    def on_event(event: Transition) -> None:
        if spool.first_time(':'.join(map(str, event.key))):
            old = is_date(event.stamp) and began - event.stamp > OLD * 1e9
            if not (old and spool.fresh):
                known = watch.valves.get(event.valve, Judgement(event.valve))
                take(news_of_event(event, known, _when(event.stamp)))

    def on_state(judgement: Judgement) -> None:
        if judgement.state != 'not_monitored':
            monitored.add(judgement.valve)
        elif judgement.valve in monitored:
            monitored.discard(judgement.valve)
            take(news_of_silence(judgement, _when(time.time_ns())))

    def report() -> Report:
        values = {'Delivered': delivery.delivered, 'Waiting': spool.count()}
        if delivery.failing:
            words = '; '.join(f'{name} {why}' for name, why in delivery.failing.items())
            return Level.ERROR, words, values
        return Level.OK, f'{len(targets)} target(s)', values

    watch.tell(
        lambda judgement: _later(loop, lambda: on_state(judgement)),
        lambda event: _later(loop, lambda: on_event(event)),
    )
    graph.tell_health('notifications', report)
    graph.start()

    async def tick() -> None:
        while True:
            await asyncio.sleep(0.1)
            desk.look(time.monotonic())

    try:
        await asyncio.gather(delivery.run(), tick())
    finally:
        graph.stop()
        desk.finish()
        spool.close()
    return 0


def _when(stamp: int) -> str:
    if not is_date(stamp):
        return f't = {stamp * 1e-9:.1f} s'
    return datetime.fromtimestamp(stamp * 1e-9).astimezone().strftime('%Y-%m-%d %H:%M:%S %z')


def _later(loop: asyncio.AbstractEventLoop, what) -> None:  # type: ignore[no-untyped-def]
    if not loop.is_closed():
        loop.call_soon_threadsafe(what)


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the command.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    words, ros_args = split_ros_args(args)
    options = parser().parse_args(words)
    return run('notify', lambda: notify(options.config, options.test, ros_args), LIBRARIES)


if __name__ == '__main__':
    sys.exit(main())
