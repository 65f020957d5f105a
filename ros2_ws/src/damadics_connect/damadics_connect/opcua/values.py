# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Make values of OPC UA from those of Python.

asyncua takes plain numbers, texts and times, but declares types of its own for them.
"""

from datetime import datetime

from asyncua import ua


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
