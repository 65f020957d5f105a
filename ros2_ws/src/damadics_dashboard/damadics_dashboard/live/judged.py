# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a detector or a fleet says of one valve, light enough for thousands of them a second."""

from typing import NamedTuple

from damadics_fd.core.stamps import SECOND
from damadics_msgs.msg import FaultFlag

# a constant of a message is looked up by a function: too slow for thousands of valves
NOT_MONITORING, LEARNING, HEALTHY, SHELVED, UNKNOWN, ALARM, LATCHED = (
    FaultFlag.STATE_NOT_MONITORING,
    FaultFlag.STATE_LEARNING,
    FaultFlag.STATE_HEALTHY,
    FaultFlag.STATE_SHELVED,
    FaultFlag.STATE_UNKNOWN,
    FaultFlag.STATE_ALARM,
    FaultFlag.STATE_LATCHED,
)
NE107 = {
    FaultFlag.NE107_NORMAL: '',
    FaultFlag.NE107_MAINTENANCE_REQUIRED: 'M',
    FaultFlag.NE107_OUT_OF_SPECIFICATION: 'S',
    FaultFlag.NE107_FUNCTION_CHECK: 'C',
    FaultFlag.NE107_FAILURE: 'F',
}


class Judged(NamedTuple):
    """Hold the fields of a FaultFlag that the page needs."""

    state: int
    level: int
    fault: bool
    residual: float
    threshold: float
    stamp: int  # ns
    onset: int  # ns
    occurrence: int


def judged_of(flag: FaultFlag) -> Judged:
    """
    Read a flag.

    :param flag: the message.
    :return: its fields.
    """
    return Judged(
        flag.state,
        flag.level,
        flag.fault,
        flag.residual,
        flag.threshold,
        flag.header.stamp.sec * SECOND + flag.header.stamp.nanosec,
        flag.onset.sec * SECOND + flag.onset.nanosec,
        flag.occurrence,
    )
