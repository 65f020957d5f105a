# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is published of one transition of an alarm, with its cause explained."""

from damadics_msgs.msg import FaultEvent, Isolation

from damadics_fd.causes import CauseTable, explain
from damadics_fd.core.decision.events import Event
from damadics_fd.core.text import SENTENCE, plain
from damadics_fd.ros.conversions import event_message, isolation_message


def explained_messages(
    event: Event, causes: CauseTable, actuator: str, frame_id: str, own: bool, remark: str
) -> tuple[FaultEvent, Isolation | None]:
    """
    Return the messages of a transition.

    :param event: the transition.
    :param causes: texts and advice.
    :param actuator: tag of the actuator, for the texts.
    :param frame_id: tag of the actuator, as the samples have it.
    :param own: the signature raised the alarm, not the threshold.
    :param remark: who caused it and why; '' for nobody.
    :return: the event; what the detector takes the fault for, None where it tells nothing of that.
    """
    explained = explain(event, causes, actuator)
    message = event_message(explained, frame_id)
    message.text = plain(message.text + remark, SENTENCE)
    return message, isolation_message(explained, frame_id, own)
