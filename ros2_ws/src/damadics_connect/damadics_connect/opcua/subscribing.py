# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Make the subscription of a feed: all of its monitored items first, then let them report."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import NamedTuple

from asyncua import Client, ua

from damadics_connect.opcua.feed import Feed
from damadics_connect.opcua.values import node_of

AHEAD = 2  # requests on their way: while the server makes the items of one, we write the next
BAD = 0x80000000
Take = Callable[[ua.PublishResult], Awaitable[None]]
Without = Callable[[int, str], None]  # number of an item, why there is none


class Made(NamedTuple):
    """A subscription and its monitored items."""

    subscription: int
    items: list[int]


async def subscribe(
    client: Client,
    feed: Feed,
    spaces: list[str],
    most: int,
    take: Take,
    without: Without,
    *,
    resting: bool,
) -> Made:
    """
    Make a subscription with all of its monitored items.

    :param client: with a session.
    :param feed: what to subscribe to; it learns after how long the server always says something.
    :param spaces: namespaces of the server.
    :param most: monitored items of one request.
    :param take: takes the messages.
    :param without: is told of each item that cannot be.
    :param resting: items report nothing before `report_from_now`: a server that samples
        thousands of them already is slow to make the others.
    :return: what was made.
    """
    session = client.uaclient.session
    parameters = ua.CreateSubscriptionParameters(
        RequestedPublishingInterval=1000.0 * feed.interval,
        RequestedMaxKeepAliveCount=max(1, round(feed.word / feed.interval)),
        RequestedLifetimeCount=max(30, round(30.0 / feed.interval)),
        MaxNotificationsPerPublish=0,
        PublishingEnabled=True,
    )
    created = await session.create_subscription(parameters, take)
    feed.patience = created.RevisedPublishingInterval * created.RevisedMaxKeepAliveCount / 1e3
    mode = ua.MonitoringMode.Disabled if resting else ua.MonitoringMode.Reporting
    requests = []
    for handle, node in enumerate(feed.nodes):
        nodeid = node_of(node, spaces)
        if nodeid is None:
            without(handle, 'not a node id such as ns=2;s=NAME')
            continue
        requests.append(
            ua.MonitoredItemCreateRequest(
                ItemToMonitor=ua.ReadValueId(NodeId=nodeid, AttributeId=ua.AttributeIds.Value),
                MonitoringMode=mode,
                RequestedParameters=ua.MonitoringParameters(
                    ClientHandle=handle,
                    SamplingInterval=1000.0 * min(feed.period / 2.0, feed.interval),
                    QueueSize=feed.queue,
                    DiscardOldest=True,
                ),
            )
        )
    made = Made(created.SubscriptionId, [])
    gate = asyncio.Semaphore(AHEAD)

    async def create(some_of: list[ua.MonitoredItemCreateRequest]) -> None:
        async with gate:
            results = await session.create_monitored_items(
                ua.CreateMonitoredItemsParameters(
                    SubscriptionId=made.subscription,
                    TimestampsToReturn=ua.TimestampsToReturn.Both,
                    ItemsToCreate=some_of,
                )
            )
        for request, result in zip(some_of, results, strict=True):
            if result.StatusCode.value & BAD:
                without(request.RequestedParameters.ClientHandle, result.StatusCode.name)
            else:
                made.items.append(result.MonitoredItemId)

    await asyncio.gather(
        *(create(requests[begin : begin + most]) for begin in range(0, len(requests), most))
    )
    return made


async def report_from_now(client: Client, made: Made, most: int) -> None:
    """
    Have monitored items report: first their present values, then each change.

    :param client: with a session.
    :param made: a subscription.
    :param most: monitored items of one request.
    """
    for begin in range(0, len(made.items), most):
        results = await client.uaclient.session.set_monitoring_mode(
            ua.SetMonitoringModeParameters(
                SubscriptionId=made.subscription,
                MonitoringMode=ua.MonitoringMode.Reporting,
                MonitoredItemIds=made.items[begin : begin + most],
            )
        )
        for result in results:
            result.check()
