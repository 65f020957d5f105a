# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Make values of OPC UA from those of Python, and read node ids and times as people write them.

asyncua takes plain numbers, texts and times, but declares types of its own for them.
"""

from collections.abc import Sequence
from datetime import datetime

from asyncua import ua

UNIX = 116_444_736_000_000_000  # 1970 in intervals of 100 ns since 1601


def node_id(identifier: int | str, space: int = 0) -> ua.NodeId:
    """
    Make a node id.

    :param identifier: a number or a text.
    :param space: index of its namespace.
    :return: the node id.
    """
    return ua.NodeId(identifier, space)  # type: ignore[arg-type]


def status_of(code: int) -> ua.StatusCode:
    """
    Make a status.

    :param code: one of `ua.StatusCodes`.
    :return: the status.
    """
    return ua.StatusCode(code)  # type: ignore[arg-type]


def data_value(
    variant: ua.Variant, source: datetime, server: datetime, status: int = ua.StatusCodes.Good
) -> ua.DataValue:
    """
    Make a value with its times.

    :param variant: the value.
    :param source: time of the value.
    :param server: time at which the server got it.
    :param status: one of `ua.StatusCodes`.
    :return: the data value.
    """
    return ua.DataValue(
        variant,
        status_of(status),
        SourceTimestamp=source,  # type: ignore[arg-type]
        ServerTimestamp=server,  # type: ignore[arg-type]
    )


def node_of(text: str, spaces: Sequence[str]) -> ua.NodeId | None:
    """
    Read a node id.

    :param text: as `ns=2;s=LV101.PV`, `i=2258` or `nsu=URI;s=LV101.PV`.
    :param spaces: URIs of the server's namespaces.
    :return: the node id; None where the text is none or the namespace is unknown.
    """
    if text.startswith('nsu='):
        uri, _, rest = text.removeprefix('nsu=').rpartition(';')
        if uri not in spaces:
            return None
        text = f'ns={spaces.index(uri)};{rest}'
    try:
        return ua.NodeId.from_string(text)
    except (ua.UaError, ValueError):
        return None


def nanoseconds_of(when: datetime | None) -> int:
    """Return a time of asyncua as ns since 1970; 0 for none."""
    if when is None:
        return 0
    return max(0, (ua.datetime_to_win_epoch(when) - UNIX) * 100)
