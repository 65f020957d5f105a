# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read node ids and times as people and servers write them."""

from collections.abc import Sequence
from datetime import datetime

from asyncua import ua

from damadics_connect.opcua.wire import UNIX


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
