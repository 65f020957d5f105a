# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Who may ask and who may act: the tokens and roles of the page, on every request."""

import ipaddress
from urllib.parse import urlsplit

from damadics_fd.store.access import Access, Grant, Role
from fastapi import HTTPException, Request

from damadics_connect.settings import Section

BEARER = 'bearer '


class Guard:
    """
    The check of a request.

    Without tokens, this machine only is answered, under its own names only, so that no foreign
    page can reach it through a name of its own. A token comes in the header `Authorization:
    Bearer TOKEN`, or as `?token=` for the event stream of a browser, which cannot send headers.

    :param access: the tokens.
    """

    def __init__(self, access: Access) -> None:
        self._access = access

    def viewer(self, request: Request) -> Grant:
        """
        Let in who may see.

        :param request: of the client.
        :return: what it may do.
        :raises HTTPException: 401 or 403 with the remedy.
        """
        _same_site(request)
        if self._access.open:
            if not loopback(_host(f'//{request.headers.get("host", "")}')):
                raise HTTPException(403, 'this name is not one of this machine')
            return Grant(Role.OPERATOR, '')
        header = request.headers.get('authorization', '')
        token = header[len(BEARER) :] if header.lower().startswith(BEARER) else ''
        grant = self._access.of(token or request.query_params.get('token', ''))
        if grant is None:
            raise HTTPException(
                401, 'send the header Authorization: Bearer TOKEN', {'WWW-Authenticate': 'Bearer'}
            )
        return grant

    def operator(self, request: Request) -> Grant:
        """
        Let in who may act.

        :param request: of the client.
        :return: what it may do.
        :raises HTTPException: 401 or 403 with the remedy.
        """
        grant = self.viewer(request)
        if grant.role is not Role.OPERATOR:
            raise HTTPException(403, 'this token may see only: an operator has to do it')
        return grant


def _same_site(request: Request) -> None:
    """Refuse what another site's page in the operator's browser sends."""
    origin = request.headers.get('origin', '')
    if not origin or request.method == 'GET':
        return
    if not _host(origin) or urlsplit(origin).netloc != request.headers.get('host'):
        raise HTTPException(403, 'this request comes from another site')


def _host(address: str) -> str:
    """Return the name of a machine in an address; '' where it is none."""
    try:
        return urlsplit(address).hostname or ''
    except ValueError:
        return ''


def loopback(host: str) -> bool:
    """
    Tell whether a name reaches this machine only.

    :param host: name or address.
    :return: True for loopback.
    """
    if host in ('localhost', 'localhost.localdomain'):
        return True
    try:
        return ipaddress.ip_address(host.strip('[]')).is_loopback
    except ValueError:
        return False


def read_guard(config: Section, host: str) -> Guard:
    """
    Read the tokens of a configuration.

    :param config: with `token_file`.
    :param host: that is served.
    :return: the guard; mistakes are noted in `config`.
    """
    access = config.tokens()
    if 'token_file' not in config and not loopback(host):
        config.refuse('host', 'opens this to the network: give a token_file (see --help)')
    return Guard(access)
