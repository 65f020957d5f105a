# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Alarms as conditions (OPC 10000-9): active, acknowledged, retained; acknowledge."""

from collections.abc import Awaitable, Callable

from asyncua import Node, Server, ua
from asyncua.server.event_generator import EventGenerator

from damadics_connect.judgement import Judgement
from damadics_connect.opcua.access import operator
from damadics_connect.opcua.address_space import ValveObject, date_of, set_type
from damadics_connect.opcua.values import node_id, status_of

SEVERITY = {  # 1..1000 (OPC 10000-5, 6.4.2)
    'normal': 100,
    'function_check': 200,
    'maintenance': 400,
    'out_of_specification': 700,
    'failure': 900,
}
ACKNOWLEDGE = node_id(ua.ObjectIds.AcknowledgeableConditionType_Acknowledge)
ALARMED = ('alarm', 'latched', 'shelved', 'unknown')
Acknowledge = Callable[[str, int, str, str], Awaitable[bool]]


class Condition:
    """
    The alarm of one valve.

    :param valve: its namespace.
    """

    def __init__(self, valve: str) -> None:
        self.valve = valve
        self.event_id = b''
        self.retained = False
        self.judgement = Judgement(valve)
        self._told: tuple[object, ...] = ()
        self._generator: EventGenerator
        self.node: Node

    async def make(self, server: Server, valve_object: ValveObject, space: int) -> None:
        """Make the condition's node and what sends its events."""
        self.node = await valve_object.alarms.add_object(
            node_id(f'{self.valve}.Alarm', space),
            ua.QualifiedName('Alarm', space),
        )
        await set_type(self.node, node_id(ua.ObjectIds.AlarmConditionType))
        self._generator = await server.get_event_generator(
            ua.ObjectIds.AlarmConditionType, ua.ObjectIds.Server
        )
        event = self._generator.event
        event.NodeId = self.node.nodeid
        event.ConditionName = 'Alarm'
        event.ConditionClassId = node_id(ua.ObjectIds.MaintenanceConditionClassType)
        event.ConditionClassName = ua.LocalizedText('Maintenance')
        event.BranchId = ua.NodeId()
        event.SourceNode = valve_object.node.nodeid
        event.ClientUserId = ''
        event.SuppressedOrShelved = False
        setattr(event, 'EnabledState/Id', True)
        event.EnabledState = ua.LocalizedText('Enabled')

    async def show(self, judgement: Judgement) -> None:
        """Tell clients when the alarm has changed."""
        self.judgement = judgement
        active = judgement.fault
        self.retained = active or (judgement.state in ALARMED and judgement.occurrence > 0)
        told = (
            active,
            self.retained,
            judgement.acknowledged,
            judgement.occurrence,
            judgement.ne107,
            judgement.text,
            judgement.state in ('not_monitored', 'unknown'),
        )
        first = not self._told
        if told == self._told or (first and not self.retained):
            self._told = self._told or told
            return
        self._told = told
        await self.send()

    async def send(self) -> None:
        """Send the condition as it is; the library repeats it for a refresh."""
        judgement, event = self.judgement, self._generator.event
        active, acknowledged = judgement.fault, judgement.acknowledged or not self.retained
        event.SourceName = judgement.actuator or judgement.valve
        event.Severity = SEVERITY[judgement.ne107]
        event.Retain = self.retained
        lost = judgement.state in ('not_monitored', 'unknown')
        event.Quality = status_of(
            ua.StatusCodes.UncertainLastUsableValue if lost else ua.StatusCodes.Good
        )
        setattr(event, 'ActiveState/Id', active)
        event.ActiveState = ua.LocalizedText('Active' if active else 'Inactive')
        setattr(event, 'AckedState/Id', acknowledged)
        event.AckedState = ua.LocalizedText('Acknowledged' if acknowledged else 'Unacknowledged')
        event.SuppressedOrShelved = judgement.state == 'shelved'
        message = judgement.text or f'{event.SourceName}: {judgement.state.replace("_", " ")}'
        await self._generator.trigger(date_of(judgement.stamp), message)
        self.event_id = event.EventId.Value


class Conditions:
    """
    The alarms of all valves.

    :param server: that has them.
    :param acknowledge: does it: valve, occurrence, user, comment; tells whether it was done.
    """

    def __init__(self, server: Server, acknowledge: Acknowledge) -> None:
        self._server = server
        self._acknowledge = acknowledge
        self.of: dict[ua.NodeId, Condition] = {}

    def prepare(self) -> None:
        """Serve the method of the standard's type."""
        method = self._server.get_node(ACKNOWLEDGE)
        self._server.link_method(method, self._acknowledged)

    async def add(self, valve: str, valve_object: ValveObject, space: int) -> Condition:
        """Make the condition of a valve."""
        condition = Condition(valve)
        await condition.make(self._server, valve_object, space)
        self.of[condition.node.nodeid] = condition
        return condition

    async def _acknowledged(
        self, parent: ua.NodeId, event_id: ua.Variant, comment: ua.Variant
    ) -> ua.StatusCode:
        """Serve Acknowledge (OPC 10000-9, 5.7.3)."""
        user = operator()
        condition = self.of.get(parent)
        if user is None:
            return status_of(ua.StatusCodes.BadUserAccessDenied)
        if condition is None:
            return status_of(ua.StatusCodes.BadNodeIdInvalid)
        if event_id.Value != condition.event_id:
            return status_of(ua.StatusCodes.BadEventIdUnknown)
        if condition.judgement.acknowledged or not condition.retained:
            return status_of(ua.StatusCodes.BadConditionBranchAlreadyAcked)
        text = comment.Value.Text if isinstance(comment.Value, ua.LocalizedText) else ''
        occurrence = condition.judgement.occurrence
        done = await self._acknowledge(condition.valve, occurrence, user.name or '', text or '')
        return status_of(ua.StatusCodes.Good if done else ua.StatusCodes.BadInvalidState)
