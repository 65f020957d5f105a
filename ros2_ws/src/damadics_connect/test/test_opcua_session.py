# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A session that is opened again, and what is told when nothing can be written."""

import asyncio

import pytest

pytest.importorskip('asyncua')
from damadics_connect.opcua import session
from damadics_connect.opcua.session import Connection, Endpoint, SessionError
from damadics_connect.opcua.written import writer
from damadics_connect.opcua.written.nodes import PlantNode

PLACE = Endpoint('opc.tcp://plc:4840')


class EnoughError(Exception):
    """Ends a loop that is for ever."""


def test_a_session_is_tried_again_with_more_patience_and_told_once(monkeypatch):
    tried, slept, lines = [], [], []
    outcomes = [
        SessionError('nobody'),
        SessionError('nobody'),
        SessionError('nobody'),
        OSError(5, 'cut'),
    ]

    async def open_session(endpoint, patience):
        tried.append(patience)
        if len(tried) in (1, 2, 3):
            raise outcomes.pop(0)
        return object()

    async def close_session(client):
        lines.append('closed')

    async def use(client):
        connection.works()
        assert not connection.fault
        raise outcomes.pop(0)

    async def sleep(seconds):
        slept.append(seconds)
        if len(slept) == 4:
            raise EnoughError

    monkeypatch.setattr(session, 'open_session', open_session)
    monkeypatch.setattr(session, 'close_session', close_session)
    monkeypatch.setattr(session.asyncio, 'sleep', sleep)
    connection = Connection(PLACE, use, lines.append, 'not connected')
    with pytest.raises(EnoughError):
        asyncio.run(connection.run())
    assert tried == [4.0, 8.0, 16.0, 32.0]
    assert slept == [0.2, 0.5, 1.0, 0.2], 'from the beginning after a session that worked'
    assert lines == ['not connected: nobody', 'closed', f'not connected: {PLACE.url}: cut']
    assert connection.fault.endswith('cut')


@pytest.mark.parametrize(('refused', 'said'), [(1, 'all others are'), (2, 'no other is')])
def test_who_can_write_nothing_says_so(monkeypatch, refused, said):
    monkeypatch.setattr(writer, 'Watch', lambda *_: None)
    lines: list[str] = []
    nodes = [PlantNode('lv1', output, f'ns=2;s={output}') for output in ('health', 'ratio')]
    plant = writer.PlantWriter(PLACE, nodes, None, lines.append)
    for node in nodes[:refused]:
        plant._refuse(node, 'no such node')
    plant._tell_refused()
    assert len(lines) == 1 and lines[0].endswith(said)
