# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Convert between messages and the core's tuples; the only place that knows both."""

import math

from builtin_interfaces.msg import Time
from damadics_msgs.msg import Estimate as EstimateMessage
from damadics_msgs.msg import FaultEvent, FaultFlag, Isolation, Measurement
from std_msgs.msg import Header

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.alarm import CHANGED, RAISED
from damadics_fd.core.decision.events import Decision, Event
from damadics_fd.core.judgement import Judgement
from damadics_fd.core.sample import Sample
from damadics_fd.core.stamps import SECOND
from damadics_fd.core.text import NAME, SENTENCE, plain

SCALARS = tuple(
    name for name in Estimate.names() if name not in ('stamp', 'alpha1', 'alpha4', 'alpha5')
)

EVENT_FIELDS = tuple(  # that event and message have in common, but for the stamps
    name
    for name in FaultEvent.get_fields_and_field_types()
    if name in Event.__dataclass_fields__ and name != 'onset'
)
FOUND_BY = ('threshold', 'signature')


def nanoseconds(time: Time) -> int:
    """
    Return a stamp as the core takes it.

    :param time: stamp of a message.
    :return: the stamp [ns].
    """
    return int(time.sec) * SECOND + int(time.nanosec)


def set_stamp(time: Time, stamp: int) -> None:
    """
    Write a stamp of the core into a message.

    :param time: stamp of a message, written.
    :param stamp: the stamp [ns].
    """
    time.sec, time.nanosec = divmod(stamp, SECOND)


def header_of(stamp: int, tag: str) -> Header:
    """
    Make a header.

    :param stamp: of the core [ns].
    :param tag: of the actuator.
    :return: the header.
    """
    header = Header(frame_id=tag)
    set_stamp(header.stamp, stamp)
    return header


def sample(message: Measurement) -> Sample:
    """
    Return a measurement as a monitor takes it.

    :param message: the measurement.
    :return: the sample.
    """
    m = message
    return Sample(nanoseconds(m.header.stamp), m.cv, m.x1, m.p1, m.p2, m.t1, m.flow, m.ps)


def read_estimate(message: EstimateMessage) -> Estimate:
    """
    Return an estimate out of its message.

    :param message: the message.
    :return: what the estimator node had.
    """
    alpha1, alpha4, alpha5 = message.alpha_hat.tolist()
    return Estimate(
        stamp=nanoseconds(message.header.stamp),
        alpha1=alpha1,
        alpha4=alpha4,
        alpha5=alpha5,
        **{name: getattr(message, name) for name in SCALARS},
    )


def write_flag(decision: Decision, message: FaultFlag) -> None:
    """
    Write a decision into a fault flag.

    :param decision: the decision.
    :param message: written, but for `frame_id`.
    """
    set_stamp(message.header.stamp, decision.stamp)
    set_stamp(message.since, decision.since)
    set_stamp(message.onset, decision.onset)
    message.fault, message.state = decision.fault, decision.state
    message.level, message.occurrence = decision.level, decision.occurrence
    message.residual, message.threshold = decision.residual, decision.threshold


def hide(message: FaultFlag) -> None:
    """
    Show a flag as not monitoring, because its judgement says nothing about now.

    :param message: state and level are written, unless it says that the alarm's state was lost.
    """
    if message.state != FaultFlag.STATE_UNKNOWN:
        message.state = FaultFlag.STATE_NOT_MONITORING
        message.level = message.level or FaultFlag.NE107_FUNCTION_CHECK


def event_message(event: Event, frame_id: str) -> FaultEvent:
    """
    Return the message of an event.

    :param event: a transition of the alarm.
    :param frame_id: tag of the actuator.
    :return: the message.
    """
    message = FaultEvent()
    message.header.frame_id = frame_id
    set_stamp(message.header.stamp, event.stamp)
    set_stamp(message.onset, event.onset)
    for name in EVENT_FIELDS:
        setattr(message, name, getattr(event, name))
    return message


def isolation_message(event: Event, frame_id: str, own: bool) -> Isolation | None:
    """
    Return what the detector takes a fault for.

    :param event: a transition of the alarm.
    :param frame_id: tag of the actuator.
    :param own: the signature raised the alarm, not the threshold.
    :return: the message; None where the transition tells nothing of the cause.
    """
    if event.transition not in (RAISED, CHANGED):
        return None
    message = Isolation(
        occurrence=event.occurrence,
        test='velocity',
        found_by=FOUND_BY[own],
        candidate=[event.cause] if event.cause else [],
        confidence=[event.confidence] if event.cause else [],
        strength=event.strength,
        deviation=event.spread,
        text=event.text,
    )
    message.header.frame_id = frame_id
    set_stamp(message.header.stamp, event.stamp)
    set_stamp(message.onset, event.onset)
    return message


def judgement_message(judgement: Judgement, frame_id: str) -> Isolation:
    """
    Return the message of what an estimator takes a fault for.

    :param judgement: of the estimator.
    :param frame_id: tag of the actuator.
    :return: the message.
    """
    message = Isolation(
        occurrence=judgement.occurrence,
        test=judgement.test,
        found_by=judgement.found_by,
        candidate=list(judgement.candidates),
        confidence=list(judgement.confidence),
        strength=judgement.strength,
        deviation=math.nan,
        text=judgement.text,
    )
    message.header.frame_id = frame_id
    set_stamp(message.header.stamp, judgement.stamp)
    set_stamp(message.onset, judgement.onset)
    return message


def read_judgement(message: Isolation) -> Judgement:
    """
    Return what an estimator takes a fault for out of its message.

    :param message: the message.
    :return: what the estimator node had.
    """
    return Judgement(
        nanoseconds(message.header.stamp),
        message.occurrence,
        plain(message.test, NAME),
        nanoseconds(message.onset),
        plain(message.found_by, NAME),
        tuple(plain(name, NAME) for name in message.candidate),
        tuple(message.confidence),
        message.strength,
        plain(message.text, SENTENCE),
    )
