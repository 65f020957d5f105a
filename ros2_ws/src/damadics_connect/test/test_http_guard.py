# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who is let in by the HTTP connector: no odd head of a request is a fault of the server."""

import pytest
from damadics_connect.http.guard import Guard
from damadics_fd.store.access import Access, Role
from fastapi import HTTPException, Request


def request(method: str = 'GET', **headers: str) -> Request:
    pairs = [(name.encode(), value.encode()) for name, value in headers.items()]
    return Request({'type': 'http', 'method': method, 'headers': pairs, 'query_string': b''})


@pytest.mark.parametrize('host', ['[::1', '', 'evil.example', '[x]:80', '127.0.0.1.evil.example'])
def test_a_name_that_is_not_of_this_machine_is_refused(host):
    with pytest.raises(HTTPException) as refused:
        Guard(Access()).viewer(request(host=host))
    assert refused.value.status_code == 403


@pytest.mark.parametrize('origin', ['http://[x', 'null', 'http://evil.example', 'http://[::1]:1'])
def test_an_action_from_another_site_is_refused(origin):
    with pytest.raises(HTTPException) as refused:
        Guard(Access()).operator(request('POST', host='127.0.0.1:1', origin=origin))
    assert refused.value.status_code == 403


@pytest.mark.parametrize('host', ['127.0.0.1:8090', 'localhost', '[::1]:8090'])
def test_this_machine_may_see_and_act(host):
    grant = Guard(Access()).operator(request('POST', host=host, origin=f'http://{host}'))
    assert grant.role is Role.OPERATOR
