# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The present judgement of all valves of a fleet in one message."""

import array

import numpy as np
from damadics_msgs.msg import FaultFlag, FleetLayout, FleetStatus
from numpy.typing import NDArray

from damadics_fd.core.record import Floats
from damadics_fd.core.signature.state import CAUSES
from damadics_fd.nodes.fleet.members import Members

CAUSE_WORDS = np.array(['', *CAUSES[1:]], dtype=object)  # by the number in a decision


def layout_message(members: Members, version: int) -> FleetLayout:
    """
    Name the valves that indices stand for.

    :param members: the valves.
    :param version: of the layout.
    :return: the message, but for its stamp.
    """
    return FleetLayout(
        version=version,
        valve=[one.namespace for one in members.all],
        actuator=[one.actuator for one in members.all],
        area=[one.area for one in members.all],
    )


def state_of(
    members: Members, ages: Floats, limits: Floats
) -> tuple[NDArray[np.uint8], NDArray[np.int8]]:
    """
    Return state and NAMUR NE 107 class of every valve; what is old is not monitored.

    :param members: the valves.
    :param ages: of their newest samples [s], NaN before the first.
    :param limits: ages from which a judgement is not healthy [s].
    :return: numbers as in FaultFlag, shape (number of valves,) each.
    """
    state = members.column('state', np.uint8)
    level = members.column('level', np.int8)
    blind = ~(ages <= limits) & (state != FaultFlag.STATE_UNKNOWN)
    state[blind] = FaultFlag.STATE_NOT_MONITORING
    level[blind & (level == FaultFlag.NE107_NORMAL)] = FaultFlag.NE107_FUNCTION_CHECK
    return state, level


def status_message(members: Members, version: int, ages: Floats, limits: Floats) -> FleetStatus:
    """
    Report on every valve.

    :param members: the valves.
    :param version: of the layout.
    :param ages: as for `state_of`.
    :param limits: as for `state_of`.
    :return: the message, but for its stamp.
    """
    state, level = state_of(members, ages, limits)
    cause = members.column('cause', np.int64)
    return FleetStatus(
        layout=version,
        valve=_column('I', np.arange(len(members), dtype=np.uint32)),
        state=_column('B', state),
        level=_column('b', level),
        fault=members.column('fault', np.bool_).tolist(),
        residual=_column('d', members.column('residual', np.float64)),
        threshold=_column('d', members.column('threshold', np.float64)),
        ratio=_column('d', members.column('ratio', np.float64)),
        age=_column('d', ages),
        progress=_column('d', members.column('progress', np.float64, estimate=True)),
        since=_column('q', members.column('since', np.int64)),
        cause=CAUSE_WORDS[cause].tolist(),
    )


def _column(code: str, values: NDArray[np.generic]) -> 'array.array[int] | array.array[float]':
    return array.array(code, np.ascontiguousarray(values).tobytes())
