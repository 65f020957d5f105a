# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a server has is found, also where it hands it over in parts."""

import asyncio
from types import SimpleNamespace

import pytest

pytest.importorskip('asyncua')
from asyncua import ua
from damadics_connect.opcua.browse import variables_of
from damadics_connect.opcua.limits import Limits, limits_of


class Server:
    """A client's view of a server with one folder, which tells two references at a time."""

    def __init__(self, limits=()):
        self.uaclient = SimpleNamespace(session=self)
        self.nodes = SimpleNamespace(objects='objects')
        self.limits = list(limits)
        names = [f'LV{n}.{end}' for n in range(4) for end in ('CV', 'PV')]
        self.parts = [names[n : n + 2] for n in range(0, len(names), 2)]
        self.largest = 0

    async def read(self, request):
        assert len(request.NodesToRead) == 1, 'it may take no more than one'
        told = self.limits.pop(0) if self.limits else None
        return [ua.DataValue(ua.Variant(told)) if told is not None else ua.DataValue()]

    def get_node(self, nodeid):
        return nodeid

    def part(self, number):
        found = [
            ua.ReferenceDescription(
                NodeId=ua.ExpandedNodeId(name, 2),
                BrowseName=ua.QualifiedName(name, 2),
                NodeClass=ua.NodeClass.Variable,
            )
            for name in self.parts[number]
        ]
        more = bytes([number + 1]) if number + 1 < len(self.parts) else None
        return ua.BrowseResult(ContinuationPoint=more, References=found)

    async def browse_nodes(self, nodes):
        self.largest = max(self.largest, len(nodes))
        return [(n, self.part(0) if n == 'objects' else ua.BrowseResult()) for n in nodes]

    async def browse_next(self, request):
        return [self.part(request.ContinuationPoints[0][0])]


def test_references_that_come_in_parts_are_all_taken():
    server = Server([0, 0, 0, 3])
    found = asyncio.run(variables_of(server))
    assert [variable.path[-1] for variable in found] == [n for part in server.parts for n in part]
    assert server.largest == 3, 'it is asked for no more than it takes'


def test_limits_are_the_smaller_of_theirs_and_ours():
    assert asyncio.run(limits_of(Server())) == Limits()
    assert asyncio.run(limits_of(Server([0, 'many', -1]))) == Limits()
    assert asyncio.run(limits_of(Server([10, 10**6, 7, 1]))) == (10, Limits().reads, 7, 1)
