# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How much a server takes in one request."""

import asyncio
from typing import NamedTuple

from asyncua import Client, ua

from damadics_connect.opcua.values import node_id

TOLD = (  # OPC 10000-5, 6.3.11: what a server says of itself, in the order of `Limits`
    ua.ObjectIds.Server_ServerCapabilities_OperationLimits_MaxMonitoredItemsPerCall,
    ua.ObjectIds.Server_ServerCapabilities_OperationLimits_MaxNodesPerRead,
    ua.ObjectIds.Server_ServerCapabilities_OperationLimits_MaxNodesPerWrite,
    ua.ObjectIds.Server_ServerCapabilities_OperationLimits_MaxNodesPerBrowse,
)


class Limits(NamedTuple):
    """Most of each in one request; as they are here: ours, so that each is answered in time."""

    items: int = 500
    reads: int = 5000
    writes: int = 500
    browses: int = 200


async def limits_of(client: Client) -> Limits:
    """
    Ask how much a server takes in one request.

    :param client: with a session.
    :return: our own limits where the server does not say, or takes more.
    """

    async def told(number: int, most: int) -> int:
        wanted = ua.ReadValueId(NodeId=node_id(number), AttributeId=ua.AttributeIds.Value)
        (data,) = await client.uaclient.session.read(ua.ReadParameters(NodesToRead=[wanted]))
        value = data.Value.Value if data.Value else 0
        return min(value, most) if isinstance(value, int) and value > 0 else most

    # each in a request of its own: it may take no more
    return Limits(*await asyncio.gather(*map(told, TOLD, Limits())))
