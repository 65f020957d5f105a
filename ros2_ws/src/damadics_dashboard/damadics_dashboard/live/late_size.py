# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The size of what an alarm has found, where it became known after its event."""

import math
from collections.abc import Sequence

from damadics_fd.core.signature.state import CAUSES
from damadics_msgs.msg import FaultEvent, Signature

from damadics_dashboard.store.history import History
from damadics_dashboard.store.rows import EventRow


def late_size(evidence: EventRow, signature: Signature | None) -> EventRow:
    """
    Return what the signature knows by now of the size of the cause that an event has told.

    :param evidence: of the alarm.
    :param signature: the latest one; None where there is none.
    :return: strength, deviation and confidence; {} where the event has told them or nobody knows.
    """
    told = evidence.get('strength')
    if signature is None or signature.state != Signature.STATE_ALARM:
        return {}
    if told is not None and math.isfinite(told) or not math.isfinite(signature.value):
        return {}
    if not 0 < signature.cause < len(CAUSES) or CAUSES[signature.cause] != evidence.get('cause'):
        return {}
    return {
        'strength': signature.value,
        'deviation': signature.std,
        'confidence': signature.confidence,
    }


class SizeKeeper:
    """
    Adds late sizes to the events of a valve in the history, from which reports are written.

    :param history: that has the events.
    """

    def __init__(self, history: History) -> None:
        self._history = history
        self._kept = -1  # stamp of the event whose size is in the history [ns]

    def keep(self, events: Sequence[EventRow], signature: Signature) -> None:
        """
        Add the size of the latest finding, once.

        :param events: of the valve, oldest first.
        :param signature: the latest one.
        """
        told = (FaultEvent.RAISED, FaultEvent.CHANGED)
        event = next((e for e in reversed(events) if e['transition'] in told), None)
        if event is None or event['stamp'] == self._kept:
            return
        size = late_size(event, signature)
        if size and self._history.complete({**event, **size}):
            self._kept = event['stamp']
