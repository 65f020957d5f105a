# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the client's own thread leaves in the event loop when the network is lost."""

import asyncio
import logging
import os

import pytest

pytest.importorskip('aiomqtt')
from damadics_connect.mqtt.broker import Broker
from damadics_connect.settings import Secret


def printed(callback, caplog) -> str:
    async def whole() -> None:
        Broker('127.0.0.1', 1883, '', Secret(), False, None).client()
        asyncio.get_running_loop().call_soon(callback)
        await asyncio.sleep(0.0)
        await asyncio.sleep(0.0)

    with caplog.at_level(logging.ERROR, logger='asyncio'):
        asyncio.run(whole())
    return caplog.text


def test_a_socket_that_was_closed_before_it_is_watched_is_no_traceback(caplog):
    def watch() -> None:
        ends = os.pipe()
        for end in ends:
            os.close(end)
        asyncio.get_running_loop().add_writer(ends[1], print)

    assert printed(watch, caplog) == ''


def test_any_other_fault_in_the_loop_is_told(caplog):
    def fault() -> None:
        raise ValueError('a fault of ours')

    assert 'a fault of ours' in printed(fault, caplog)
