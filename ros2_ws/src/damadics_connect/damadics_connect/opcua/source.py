# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Signals in: follow the nodes of every valve on an OPC UA server."""

import asyncio
import time
from collections.abc import Callable, Sequence
from functools import partial

from asyncua import Client, ua
from damadics_fd.core.sample import SIGNALS
from damadics_fd.ros.diagnostics import Report

from damadics_connect.health import report, some
from damadics_connect.opcua.feed import Feed, Item, Options
from damadics_connect.opcua.limits import Limits, limits_of
from damadics_connect.opcua.session import Connection, Endpoint, SessionError
from damadics_connect.opcua.subscribing import Made, report_from_now, subscribe
from damadics_connect.opcua.values import nanoseconds_of, node_of
from damadics_connect.opcua.wire import Changes, WireError, read_changes
from damadics_connect.publishing import Output
from damadics_connect.valve_list import ValveSource

HELD_UP = 0.5  # s that our own process may be late before its lateness counts
QUIET = 1.6  # s without a word, beside its usual time, after which the server counts as gone
GIVE_UP = 5.0  # s without a word after which the session is ended: until then it may go on, and
# what the server has kept of its changes with it
CANNOT = (ua.uaerrors.BadServiceUnsupported, ua.uaerrors.BadNotImplemented)
Log = Callable[[str], None]


class Source:
    """
    A server and the valves on it.

    :param endpoint: the server.
    :param valves: in the order of the output's numbers.
    :param options: how the server is asked.
    :param output: takes the samples.
    :param log: takes what a person should know.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        valves: Sequence[ValveSource],
        options: Options,
        output: Output,
        log: Log,
    ) -> None:
        self._connection = Connection(endpoint, self._follow, log, 'not connected')
        self._poll = options.poll
        self._resting = True  # items report once all of them are there
        self._output = output
        self._log = log
        by_period: dict[float, dict[int, ValveSource]] = {}
        for number, valve in enumerate(valves):
            by_period.setdefault(valve.period, {})[number] = valve
        self._feeds = [Feed(period, group, options, output) for period, group in by_period.items()]
        self._joiners = {n: joiner for feed in self._feeds for n, joiner in feed.joiners.items()}
        self._ended = False  # the server has ended a subscription
        self._unknown: dict[str, str] = {}
        self._sessions = self._values = self._garbled = 0

    async def run(self) -> None:
        """Follow the server for ever; connect again whenever it was lost."""
        await self._connection.run()

    def report(self) -> Report:
        """Say how the server and the valves are."""
        values = {
            'Server': self._connection.place,
            'Connected': not self._connection.fault,
            'Sessions': self._sessions,
            'Values': self._values,
            'Values lost by the server': sum(feed.lost for feed in self._feeds),
            'Unreadable messages': self._garbled,
        }
        unknown = [f'{node} ({cause})' for node, cause in self._unknown.items()]
        problems = [f'no such node: {some(unknown)}'] if unknown else []
        now = min(feed.at for feed in self._feeds)
        fault = self._connection.fault
        return report(fault, self._joiners, self._output, values, problems, now)

    async def _follow(self, client: Client) -> None:
        """Subscribe to everything, then look after it until the server falls silent."""
        self._sessions += 1
        self._ended = False
        self._unknown.clear()
        spaces = await client.get_namespace_array()
        limits = await limits_of(client)
        made: dict[Feed, Made] = {}
        for feed in self._feeds:
            feed.begin(time.monotonic_ns())
            subscription = None
            if not self._poll:
                subscription = await self._subscribe(client, feed, spaces, limits)
            if subscription is not None:
                made[feed] = subscription
        polled = [
            asyncio.create_task(self._read_on(client, feed, spaces, limits.reads))
            for feed in self._feeds
            if feed not in made
        ]
        await self._report(client, made, limits)
        for feed in self._feeds:
            feed.heard = time.monotonic()  # while they were made, nobody spoke
        self._connection.works()
        self._log(f'connected to {self._connection.place}: {len(self._joiners)} valve(s)')
        if self._unknown:
            self._log(f'no such node: {some([f"{n} ({c})" for n, c in self._unknown.items()])}')
        tick = min(feed.tick for feed in self._feeds)
        due = [0.0] * len(self._feeds)
        try:
            while True:
                asleep = time.monotonic()
                await asyncio.sleep(tick)
                held_up = time.monotonic() - asleep - tick
                if held_up > HELD_UP:
                    for feed in self._feeds:
                        feed.heard += held_up  # it is us who were: what has come waits to be read
                if self._ended:
                    place = self._connection.place
                    raise SessionError(f'{place}: the server has ended our subscription')
                self._tell_silence()
                for task in polled:
                    if task.done():
                        task.result()
                for number, feed in enumerate(self._feeds):
                    if not feed.prompt and (moment := time.monotonic()) >= due[number]:
                        due[number] = moment + feed.tick
                        feed.look(time.monotonic_ns())
                self._output.flush()
        finally:
            for task in polled:
                task.cancel()

    def _tell_silence(self) -> None:
        """
        Tell that the server has fallen silent, or speaks again.

        :raises SessionError: where it has been silent for too long.
        """
        now, connection = time.monotonic(), self._connection
        silent = max(now - feed.heard - max(feed.interval, feed.patience) for feed in self._feeds)
        cause = f'{connection.place}: silent for {QUIET:g} s and more: server or network is gone'
        if silent > GIVE_UP:
            raise SessionError(cause)
        if silent > QUIET:
            connection.fails(cause)
        elif connection.fault:
            connection.works()
            self._log(f'connected to {connection.place} again')

    async def _subscribe(
        self, client: Client, feed: Feed, spaces: list[str], limits: Limits
    ) -> Made | None:
        """Make the subscription of a feed; None where the server has none."""

        def without(handle: int, cause: str) -> None:
            self._without(feed.items[handle], feed.nodes[handle], cause)

        try:
            return await subscribe(
                client,
                feed,
                spaces,
                limits.items,
                partial(self._take, feed),
                without,
                resting=self._resting,
            )
        except CANNOT:
            self._log('the server has no subscriptions: its values are read')
            return None

    async def _report(self, client: Client, made: dict[Feed, Made], limits: Limits) -> None:
        """Have all that was made report from now on."""
        for feed in made:
            feed.begin(time.monotonic_ns(), feed.patience)
        if not self._resting:
            return
        try:
            for subscription in made.values():
                await report_from_now(client, subscription, limits.items)
        except CANNOT:
            self._resting = False
            place = self._connection.place
            raise SessionError(f'{place}: has no SetMonitoringMode; it is done without') from None

    def _without(self, item: Item, node: str, cause: str) -> None:
        item.joiner.without(item.slot)
        item.joiner.tally.bad[SIGNALS[item.slot]] = cause
        self._unknown[node[:60]] = cause

    async def _take(self, feed: Feed, result: ua.PublishResult) -> None:
        """Take one message of a subscription."""
        now = time.monotonic_ns()
        found = []
        for notification in result.NotificationMessage.NotificationData or ():
            if isinstance(notification, ua.ExtensionObject):
                try:
                    found.append(read_changes(notification.Body or b''))
                except WireError:
                    self._garbled += 1
            elif isinstance(notification, ua.StatusChangeNotification):
                self._ended = True
        published = nanoseconds_of(result.NotificationMessage.PublishTime)
        self._take_changes(feed, found, published, now, all_of=not result.MoreNotifications)

    def _take_changes(
        self, feed: Feed, found: Sequence[Changes], published: int, now: int, *, all_of: bool
    ) -> None:
        """Take what has changed, if anything has; send what is due, if `all_of` it has come."""
        at = feed.hear(published, now)
        for changes in found:
            self._values += len(changes.handle)
            feed.take(changes, published or time.time_ns(), at)
        if all_of:
            feed.look(at)
        self._output.flush()

    async def _read_on(self, client: Client, feed: Feed, spaces: list[str], most: int) -> None:
        """Read the values of a feed once a period, for servers without subscriptions."""
        ids = [node_of(node, spaces) or ua.NodeId() for node in feed.nodes]
        wanted = [ua.ReadValueId(NodeId=i, AttributeId=ua.AttributeIds.Value) for i in ids]
        requests = [
            ua.ReadParameters(
                TimestampsToReturn=ua.TimestampsToReturn.Both,
                NodesToRead=wanted[begin : begin + most],
            )
            for begin in range(0, len(wanted), most)
        ]
        feed.patience = feed.period
        due = time.monotonic()
        while True:
            results = []
            for request in requests:
                results += await client.uaclient.session.read(request)
            now = time.monotonic_ns()
            changes = Changes([], [], [], [], [])
            for handle, result in enumerate(results):
                value = result.Value.Value if result.Value is not None else None
                number = isinstance(value, int | float)
                stamp = nanoseconds_of(result.SourceTimestamp) or nanoseconds_of(
                    result.ServerTimestamp
                )
                changes.add(
                    handle,
                    float(value) if isinstance(value, int | float) else float('nan'),
                    result.StatusCode.value if result.StatusCode else 0,
                    stamp,
                    '' if number else type(value).__name__,
                )
            self._take_changes(feed, [changes], 0, now, all_of=True)
            due = max(due + feed.period, time.monotonic() - feed.period)
            await asyncio.sleep(max(0.0, due - time.monotonic()))
