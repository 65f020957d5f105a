# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
One object per valve, with the browse names of PA-DIM (OPC 30081) and its base, DI (OPC 10000-100).

The types are made here with the names that clients look for; where nodeset files of the OPC
Foundation are given, their types are used.
"""

import math
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

from asyncua import Node, Server, ua
from damadics_fd.core.stamps import is_date

from damadics_connect.judgement import CLASSES, Judgement
from damadics_connect.opcua.values import data_value, node_id

OWN = 'urn:damadics:fd'
DI = 'http://opcfoundation.org/UA/DI/'
PADIM = 'http://opcfoundation.org/UA/PADIM/'
PADIM_TYPE = 1009  # PADIMType in the nodeset of PA-DIM
HEALTH = dict(zip(CLASSES, (0, 4, 3, 2, 1), strict=True))  # DeviceHealthEnumeration of DI
DOUBLE, STRING = ua.VariantType.Double, ua.VariantType.String
BOOLEAN, UINT32 = ua.VariantType.Boolean, ua.VariantType.UInt32
NUMBERS = {  # of our own namespace: field of a judgement and what it is
    'Residual': ('residual', 'residual in the unit of the mode'),
    'Limit': ('threshold', 'limit of the residual, same unit'),
    'Ratio': ('ratio', 'residual / limit'),
    'Confidence': ('confidence', 'probability of the cause'),
    'Size': ('strength', 'change in the unit of the cause'),
}
TEXTS = {'State': 'state', 'Cause': 'cause', 'Text': 'text', 'Advice': 'advice'}
TRENDS = ('TrendSpring', 'TrendPreload', 'TrendFriction')  # change a day
JUDGED = ('Residual', 'Limit', 'Ratio')


class Spaces(NamedTuple):
    """Indices of the namespaces and the type of a valve."""

    own: int
    di: int
    padim: int
    type_id: ua.NodeId


async def prepare(server: Server, nodesets: Sequence[Path]) -> Spaces:
    """
    Register the namespaces and find or make the type.

    :param server: initialised.
    :param nodesets: files of the OPC Foundation, in the order of their dependence.
    :return: where things are.
    """
    for path in nodesets:
        await server.import_xml(str(path))
    own, di, padim = [await server.register_namespace(uri) for uri in (OWN, DI, PADIM)]
    standard = node_id(PADIM_TYPE, padim)
    if standard in server.iserver.aspace:
        return Spaces(own, di, padim, standard)
    base = server.get_node(node_id(ua.ObjectIds.BaseObjectType))
    made = await base.add_object_type(standard, ua.QualifiedName('PADIMType', padim))
    for space, name, value in (
        (di, 'DeviceHealth', 0),
        (di, 'AssetId', ''),
        (padim, 'DateOfLastChange', datetime(1970, 1, 1, tzinfo=UTC)),
    ):
        member = await made.add_variable(
            node_id(f'PADIMType.{name}', padim), ua.QualifiedName(name, space), value
        )
        await member.set_modelling_rule(True)
    return Spaces(own, di, padim, standard)


class ValveObject:
    """
    The object of one valve.

    :param server: that it is on.
    :param spaces: of the server.
    """

    def __init__(self, server: Server, spaces: Spaces) -> None:
        self._write = server.iserver.aspace.write_attribute_value
        self._server = server
        self._spaces = spaces
        self._nodes: dict[str, ua.NodeId] = {}
        self._shown: dict[str, ua.DataValue] = {}
        self.alarms: Node
        self.node: Node

    async def make(self, parent: Node, valve: str, actuator: str) -> None:
        """
        Make the nodes.

        :param parent: folder of the valves.
        :param valve: namespace of the valve: part of the node ids.
        :param actuator: its tag: its browse name.
        """
        spaces = self._spaces
        self.node = await parent.add_object(
            node_id(valve, spaces.own),
            ua.QualifiedName(actuator or valve, spaces.own),
        )
        await set_type(self.node, spaces.type_id)

        async def variable(space: int, name: str, value: ua.Variant, under: Node) -> None:
            nodeid = node_id(f'{valve}.{name}', spaces.own)
            await under.add_variable(nodeid, ua.QualifiedName(name, space), value)
            self._nodes[name] = nodeid

        await variable(spaces.di, 'DeviceHealth', ua.Variant(2, ua.VariantType.Int32), self.node)
        await variable(spaces.di, 'AssetId', ua.Variant(actuator, STRING), self.node)
        epoch = ua.Variant(datetime(1970, 1, 1, tzinfo=UTC), ua.VariantType.DateTime)
        await variable(spaces.padim, 'DateOfLastChange', epoch, self.node)
        counters = await self.node.add_object(
            node_id(f'{valve}.OperationCounters', spaces.own),
            ua.QualifiedName('OperationCounters', spaces.di),
        )
        await variable(spaces.di, 'OperationCycleCounter', ua.Variant(0, UINT32), counters)
        self.alarms = await self.node.add_folder(
            node_id(f'{valve}.DeviceHealthAlarms', spaces.own),
            ua.QualifiedName('DeviceHealthAlarms', spaces.di),
        )
        for name in (*NUMBERS, *TRENDS):
            await variable(spaces.own, name, ua.Variant(math.nan, DOUBLE), self.node)
        for name in TEXTS:
            await variable(spaces.own, name, ua.Variant('', STRING), self.node)
        for name in ('Fault', 'Acknowledged'):
            await variable(spaces.own, name, ua.Variant(False, BOOLEAN), self.node)
        await variable(spaces.own, 'Occurrence', ua.Variant(0, UINT32), self.node)
        for name in ('DateOfLastChange', 'OperationCycleCounter', *TRENDS):
            await self._set(name, None, UINT32, 0, ua.StatusCodes.BadNoData)

    async def show(self, judgement: Judgement) -> None:
        """Write a judgement; what rests on no fresh sample is of bad quality."""
        stamp = judgement.stamp
        lost = judgement.state in ('not_monitored', 'unknown')
        status = ua.StatusCodes.BadNoCommunication if lost else ua.StatusCodes.Good
        health = HEALTH[judgement.ne107]
        await self._set('DeviceHealth', health, ua.VariantType.Int32, stamp)
        for name, (field, _) in NUMBERS.items():
            value = float(getattr(judgement, field))
            code = status if name in JUDGED else ua.StatusCodes.Good
            if math.isnan(value) and code == ua.StatusCodes.Good:
                code = ua.StatusCodes.BadNoData
            await self._set(name, value, DOUBLE, stamp, code)
        for name, field in TEXTS.items():
            await self._set(name, getattr(judgement, field), STRING, stamp)
        await self._set('Fault', judgement.fault, BOOLEAN, stamp)
        await self._set('Acknowledged', judgement.acknowledged, BOOLEAN, stamp)
        await self._set('Occurrence', judgement.occurrence, UINT32, stamp)

    async def show_trend(self, trend: Sequence[float], stamp: int) -> None:
        """Write the trends of spring, preload and friction a day."""
        for name, value in zip(TRENDS, trend, strict=True):
            code = ua.StatusCodes.BadNoData if math.isnan(value) else ua.StatusCodes.Good
            await self._set(name, float(value), DOUBLE, stamp, code)

    async def show_cycles(self, count: int) -> None:
        """Write how often the stem has begun to move."""
        await self._set('OperationCycleCounter', count, UINT32, 0)

    async def show_reference(self, stamp: int) -> None:
        """Write when the reference was learned or loaded."""
        when = date_of(stamp) or datetime.now(UTC)
        await self._set('DateOfLastChange', when, ua.VariantType.DateTime, 0)

    async def _set(
        self,
        name: str,
        value: float | str | bool | datetime | None,
        kind: ua.VariantType,
        stamp: int,
        status: int = ua.StatusCodes.Good,
    ) -> None:
        now = datetime.now(UTC)
        variant = ua.Variant(value, kind) if status == ua.StatusCodes.Good else ua.Variant()
        shown = data_value(variant, date_of(stamp) or now, now, status)
        before = self._shown.get(name)
        same = before is not None and (before.Value, before.StatusCode) == (
            shown.Value,
            shown.StatusCode,
        )
        if not same or name in ('Residual', 'DeviceHealth'):
            self._shown[name] = shown
            await self._write(self._nodes[name], ua.AttributeIds.Value, shown)


async def set_type(node: Node, type_id: ua.NodeId) -> None:
    """
    Give an object its type without instances of all that the type may have.

    :param node: an object of the base type.
    :param type_id: its type.
    """
    await node.delete_reference(
        node_id(ua.ObjectIds.BaseObjectType), ua.ObjectIds.HasTypeDefinition, True, False
    )
    await node.add_reference(type_id, ua.ObjectIds.HasTypeDefinition, True, False)


def date_of(stamp: int) -> datetime | None:
    """
    Return a stamp as OPC UA takes it.

    :param stamp: [ns].
    :return: in UTC; None where it is no date.
    """
    if not is_date(stamp):
        return None
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(microseconds=stamp // 1000)
