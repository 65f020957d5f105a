# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages as rows of the history; their texts come through one door."""

import math

from damadics_fd.core.stamps import SECOND as NANO
from damadics_fd.core.text import COMMENT, NAME, SENTENCE, plain
from damadics_msgs.msg import FaultEvent, OperatorAction

from damadics_dashboard.store.rows import ActionRow, EventRow

ACTIONS = (
    'acknowledge',
    'reset',
    'shelve',
    'relearn',
    'save_reference',
    'load_reference',
    'partial_stroke',
)


def event_row(valve: str, message: FaultEvent) -> EventRow:
    """
    Return an event as the history keeps it.

    :param valve: name of the valve.
    :param message: the event.
    :return: row without `seen`.
    """
    return {
        'valve': valve,
        'stamp': message.header.stamp.sec * NANO + message.header.stamp.nanosec,
        'onset': message.onset.sec * NANO + message.onset.nanosec,
        'transition': message.transition,
        'occurrence': message.occurrence,
        'level': message.level,
        'cause': plain(message.cause, NAME),
        'text': plain(message.text, SENTENCE),
        'advice': plain(message.advice, SENTENCE),
        'residual': _known(message.residual),
        'threshold': _known(message.threshold),
        'ratio': _known(message.ratio),
        'duration': _known(message.duration),
        'confidence': _known(message.confidence),
        'strength': _known(message.strength),
    }


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def action_row(valve: str, message: OperatorAction) -> ActionRow:
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
