# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Judgements out: an OPC UA server of our own."""

import asyncio
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from asyncua import Server, ua
from damadics_fd.ros import qos
from damadics_fd.store.access import Access
from damadics_msgs.msg import OperatorAction, Signature
from rclpy.node import Node as RosNode

from damadics_connect.actions import Actions
from damadics_connect.judgement import NANO
from damadics_connect.opcua.access import Doorman, Rules
from damadics_connect.opcua.address_space import ValveObject, prepare
from damadics_connect.opcua.conditions import Condition, Conditions
from damadics_connect.opcua.values import node_id
from damadics_connect.process import ConnectError
from damadics_connect.settings import Section
from damadics_connect.watch import Watch, topic_of

LOOK = 0.1  # s between two looks at what has changed
NUMBERS = 1.0  # s between two updates of running numbers
REFERENCE = (OperatorAction.RELEARN, OperatorAction.LOAD_REFERENCE)


class ServeSettings(NamedTuple):
    """How judgements are served."""

    endpoint: str
    access: Access
    nodesets: tuple[Path, ...]
    certificate: Path | None
    key: Path | None


def read_serve(config: Section) -> ServeSettings | None:
    """
    Read the entry `serve`.

    :param config: the whole file.
    :return: None where nothing is served; mistakes are noted in `config`.
    """
    if 'serve' not in config:
        config.section('serve')
        return None
    serve = config.section('serve')
    endpoint = serve.text('endpoint', 'opc.tcp://127.0.0.1:4841')
    if not endpoint.startswith('opc.tcp://'):
        serve.refuse('endpoint', 'does not begin with opc.tcp://')
    access = serve.tokens()
    nodesets = tuple(serve.folder / Path(name).expanduser() for name in serve.texts('nodesets'))
    for path in nodesets:
        if not path.is_file():
            serve.problems.append(f'serve.nodesets: {path} does not exist')
    certificate, key = serve.path('certificate'), serve.path('key')
    if (certificate is None) != (key is None):
        serve.refuse('certificate', 'and key belong together: give both')
    serve.done()
    return ServeSettings(endpoint, access, nodesets, certificate, key)


class Judgements:
    """
    The server.

    :param settings: how it serves.
    :param node: of ROS 2.
    :param cycles: how often each valve has begun to move, by name.
    :param log: takes what a person should know.
    """

    def __init__(
        self,
        settings: ServeSettings,
        node: RosNode,
        cycles: Mapping[str, int],
        log: Callable[[str], None],
    ) -> None:
        self._settings = settings
        self._node = node
        self._cycles = cycles
        self._log = log
        self._changed: set[str] = set()
        self._trends: dict[str, Signature] = {}
        self._references: dict[str, int] = {}
        self._objects: dict[str, tuple[ValveObject, Condition]] = {}
        self._watch = Watch(node, lambda judgement: self._changed.add(judgement.valve))
        self._actions = Actions(node, self._watch)

    async def run(self) -> None:
        """Serve for ever."""
        settings = self._settings
        server = Server(user_manager=Doorman(settings.access))
        server.iserver.bind_condition_methods = 100  # ConditionRefresh
        await server.init()
        server.set_endpoint(settings.endpoint)
        server.set_server_name('DAMADICS FD')
        policies = [ua.SecurityPolicyType.NoSecurity]
        if settings.certificate and settings.key:
            policies = [ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt]
            await server.load_certificate(str(settings.certificate))
            await server.load_private_key(str(settings.key))
        rules = Rules()  # type: ignore[no-untyped-call]
        server.set_security_policy(policies, permission_ruleset=rules)
        if not settings.access.open:
            server.set_identity_tokens([ua.UserNameIdentityToken])
        try:
            spaces = await prepare(server, settings.nodesets)
        except Exception as problem:  # the library raises what it likes on files of others
            raise ConnectError(
                f'serve.nodesets: cannot be taken in ({type(problem).__name__}): give whole '
                'files, those that they depend on before them'
            ) from None
        conditions = Conditions(server, self._acknowledge)
        conditions.prepare()
        folder = await server.nodes.objects.add_folder(
            node_id('Valves', spaces.own), ua.QualifiedName('Valves', spaces.own)
        )
        try:
            await server.start()
        except OSError as problem:
            raise ConnectError(
                f'cannot serve on {settings.endpoint}: {problem.strerror}: give another port'
            ) from None
        self._log(f'serving judgements on {settings.endpoint}')
        try:
            due = 0.0
            while True:
                await asyncio.sleep(LOOK)
                names, self._changed = self._changed, set()
                if time.monotonic() >= due:
                    due = time.monotonic() + NUMBERS
                    names |= self._watch.valves.keys()
                for name in sorted(names):
                    if name not in self._objects:
                        valve = ValveObject(server, spaces)
                        await valve.make(folder, name, self._watch.valves[name].actuator)
                        condition = await conditions.add(name, valve, spaces.own)
                        self._objects[name] = valve, condition
                        self._follow(name)
                    await self._show(name)
        finally:
            await server.stop()

    async def _show(self, name: str) -> None:
        valve, condition = self._objects[name]
        judgement = self._watch.valves[name]
        await valve.show(judgement)
        await condition.show(judgement)
        if (signature := self._trends.pop(name, None)) is not None:
            stamp = signature.header.stamp
            await valve.show_trend(signature.trend.tolist(), stamp.sec * NANO + stamp.nanosec)
        if name in self._cycles:
            await valve.show_cycles(self._cycles[name])
        if (stamp_of := self._references.pop(name, 0)) > 0:
            await valve.show_reference(stamp_of)

    def _follow(self, name: str) -> None:
        """Take what only the server shows: trends, and when the reference was changed."""

        def take_signature(message: Signature) -> None:
            self._trends[name] = message

        def take_action(message: OperatorAction) -> None:
            if message.success and message.action in REFERENCE:
                stamp = message.header.stamp
                self._references[name] = stamp.sec * NANO + stamp.nanosec

        self._node.create_subscription(
            Signature, topic_of(name, 'signature'), take_signature, qos.FLAG
        )
        self._node.create_subscription(
            OperatorAction, topic_of(name, 'operator_action'), take_action, qos.EVENTS
        )

    async def _acknowledge(self, valve: str, occurrence: int, user: str, comment: str) -> bool:
        answer = await self._actions.do('acknowledge', valve, user, comment, occurrence=occurrence)
        return answer.done
