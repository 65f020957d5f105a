# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a detector tells of itself in the diagnostics."""

from collections.abc import Mapping

from damadics_fd.core.decision.alarm import NE107, STATE_UNKNOWN
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.decision.events import Decision
from damadics_fd.nodes.alarm_memory import AlarmMemory
from damadics_fd.nodes.signature_publisher import SignaturePublisher
from damadics_fd.ros.diagnostics import Level, Report

LOST = 'the alarm of before is lost: look at the valve, then acknowledge'


def report_of(
    decision: Decision,
    core: Detector,
    memory: AlarmMemory,
    signature: SignaturePublisher,
    *,
    judged: int,
    twice: int,
    rival: str,
    silent: bool,
    more: Mapping[str, str],
) -> Report:
    """
    Say what is judged.

    :param decision: the latest.
    :param core: the detector.
    :param memory: of its alarm.
    :param signature: of the valve.
    :param judged: estimates judged.
    :param twice: estimates that came a second time.
    :param rival: another detector judges the valve, '' if none does.
    :param silent: none comes any more.
    :param more: further values.
    :return: level, one sentence, values by name: what is worst comes first.
    """
    statistics = core.statistics
    values = {
        'Fault': decision.fault,
        'Residual (1/s)': decision.residual,
        'Threshold (1/s)': decision.threshold,
        'Ratio': decision.residual / decision.threshold if decision.threshold else 0.0,
        'Faults since the start': decision.occurrence,
        'Acknowledged': decision.acknowledged,
        'Near misses': statistics['near_misses'],
        'Chatter': bool(statistics['chatter']),
        'Estimates judged': judged,
        'Estimates received twice': twice,
        'NE 107': NE107[decision.level],
        **memory.values,
        **signature.values,
        **more,
    }
    if memory.problem:
        return Level.ERROR, memory.problem, values
    if decision.state == STATE_UNKNOWN:
        return Level.ERROR, LOST, values
    if silent:
        return Level.ERROR, 'estimates have stopped: not monitoring', values
    if rival:
        return Level.ERROR, rival, values
    if decision.fault:
        return Level.ERROR, f'fault {decision.occurrence} flagged', values
    if twice:
        return Level.WARN, 'estimates arrive twice: end one of the estimators', values
    if decision.level:
        return Level.WARN, f'{NE107[decision.level]}: no faults are reported', values
    if signature.problem:
        return Level.WARN, signature.problem, values
    return Level.OK, 'no fault flagged', values
