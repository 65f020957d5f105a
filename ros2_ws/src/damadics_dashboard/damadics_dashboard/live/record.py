# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages as rows of the history; their texts come through one door."""

import math
from typing import Any

from damadics_fd.core.stamps import SECOND as NANO
from damadics_fd.core.text import COMMENT, NAME, SENTENCE, plain
from damadics_msgs.msg import FaultEvent, OperatorAction

NUMBERS = ('residual', 'threshold', 'ratio', 'duration', 'confidence', 'strength')
ACTIONS = (
    'acknowledge',
    'reset',
    'shelve',
    'relearn',
    'save_reference',
    'load_reference',
    'partial_stroke',
)


def event_row(valve: str, message: FaultEvent) -> dict[str, Any]:
    """
    Return an event as the history keeps it.

    :param valve: name of the valve.
    :param message: the event.
    :return: row without `seen`.
    """
    row: dict[str, Any] = {
        'valve': valve,
        'stamp': message.header.stamp.sec * NANO + message.header.stamp.nanosec,
        'onset': message.onset.sec * NANO + message.onset.nanosec,
        'transition': message.transition,
        'occurrence': message.occurrence,
        'level': message.level,
        'cause': plain(message.cause, NAME),
        'text': plain(message.text, SENTENCE),
        'advice': plain(message.advice, SENTENCE),
    }
    for name in NUMBERS:
        value = getattr(message, name)
        row[name] = value if math.isfinite(value) else None
    return row


def action_row(valve: str, message: OperatorAction) -> dict[str, Any]:
    """
    Return what a person did as the history keeps it.

    :param valve: name of the valve.
    :param message: the action.
    :return: row without `seen`.
    """
    known = message.action < len(ACTIONS)
    return {
        'valve': valve,
        'action': ACTIONS[message.action] if known else str(message.action),
        'user': plain(message.user, NAME),
        'role': plain(message.role, NAME),
        'comment': plain(message.comment, COMMENT),
        'done': int(message.success),
        'result': plain(message.result, COMMENT),
    }
