# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Addresses that may have secrets in them."""

from urllib.parse import urlsplit


def shown(url: str) -> str:
    """
    Return an address without the secrets in it.

    :param url: an address, perhaps with user, password or a query.
    :return: scheme, host, port and path.

    >>> shown('mqtt://me:secret@plant:1883/x?token=abc')
    'mqtt://plant:1883/x'
    """
    try:
        parts = urlsplit(url)
    except ValueError:
        return 'an address that cannot be read'
    host = parts.netloc.rpartition('@')[2]
    return f'{parts.scheme}://{host}{parts.path}' if parts.scheme else parts.path


def address_problem(url: str, *schemes: str) -> str:
    """
    Tell why an address cannot be used.

    :param url: an address.
    :param schemes: what it may begin with, such as `opc.tcp`.
    :return: part of a sentence, which shows nothing of it; '' for a good one.

    >>> address_problem('opc.tcp://me:secret@plc:4840', 'opc.tcp')
    'has a user in it: give user.name and user.password_file'
    """
    try:
        parts = urlsplit(url)
        host, _ = parts.hostname, parts.port
    except ValueError:
        return f'is no address such as {schemes[0]}://plant.example'
    if parts.scheme not in schemes:
        return f'does not begin with {" or ".join(f"{scheme}://" for scheme in schemes)}'
    if '@' in parts.netloc:
        return 'has a user in it: give user.name and user.password_file'
    return '' if host else f'names no host, such as {schemes[0]}://plant.example'
