# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The size of what an alarm has found, where it became known after its event."""

import math

from damadics_fd.core.signature.state import CAUSES
from damadics_msgs.msg import Signature

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
