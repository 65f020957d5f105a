# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the web page is served with, checked before anything is started."""

import argparse
import ipaddress
import os
import socket
from pathlib import Path

from damadics_fd.store.access import HOW_TO, AccessError, read_access


def port(text: str) -> int:
    """
    Read the number of a port.

    :param text: of the command line.
    :return: from 1 to 65535.
    :raises ArgumentTypeError: otherwise.
    """
    if not text.isascii() or not text.isdigit() or not 0 < int(text[:6]) < 65536:
        raise argparse.ArgumentTypeError(f'{text!r} is no port: give a number from 1 to 65535')
    return int(text)


def check_page(host: str, number: int, tokens: Path | None) -> None:
    """
    Refuse what the web page could never be served with.

    :param host: name or address to serve on.
    :param number: of the port.
    :param tokens: file of the tokens that other machines must show.
    :raises AccessError: with the cause and the remedy.
    """
    if tokens:
        read_access(tokens)
    elif not os.environ.get('DAMADICS_DASHBOARD_TOKEN') and not _loopback(host):
        raise AccessError(
            f'--host {host} opens the page to the network: give the tokens that it asks '
            f'for with --token-file ({HOW_TO}), or leave --host at 127.0.0.1'
        )
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, number, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind(address)
    except OSError as problem:
        raise AccessError(
            f'the page cannot be served at {host} port {number}: '
            f'{problem.strerror}; give another --host or --port'
        ) from problem


def _loopback(host: str) -> bool:
    try:
        return host == 'localhost' or ipaddress.ip_address(host.strip('[]')).is_loopback
    except ValueError:
        return False
