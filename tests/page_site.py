# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A dashboard fed by the test itself: valves that say what the test wants, without a plant."""

import atexit
import json
import threading
import time
from pathlib import Path
from typing import Any

import rclpy
import website
from conftest import alone, free_port
from damadics_bringup.processes import Processes, surroundings
from damadics_fd.ros import qos
from damadics_msgs.msg import (
    FaultEvent,
    FaultFlag,
    FleetLayout,
    FleetStatus,
    Isolation,
    OperatorAction,
    Signature,
)
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

NANO = 1_000_000_000


def axe_source() -> str:
    """Return axe-core, which the wheel of axe-playwright-python carries."""
    import axe_playwright_python

    return Path(axe_playwright_python.__file__).with_name('axe.min.js').read_text('utf-8')


def violations(page: Any) -> dict[str, Any]:
    """Return what axe-core says of the page as it stands."""
    page.evaluate(axe_source())
    return page.evaluate('axe.run(document, {resultTypes: ["violations"]})')


def serious(page: Any) -> list[str]:
    """List the violations of class serious or above that axe-core finds."""
    from playwright.sync_api import Error

    try:
        found = violations(page)
    except Error as error:
        if 'Execution context was destroyed' not in str(error):
            raise
        page.wait_for_timeout(3000)  # it lost its server for a while, and has loaded anew
        found = violations(page)
    return [
        f'{v["id"]}: {json.dumps([n["html"][:160] for n in v["nodes"]][:3])}'
        for v in found['violations']
        if v['impact'] in ('serious', 'critical')
    ]


class Voices:
    """Publishers of what detectors say, in a thread of their own."""

    def __init__(self, domain: int) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node('voices', context=self.context)
        self._publishers: dict[str, Any] = {}
        self._flags: dict[str, FaultFlag] = {}
        self._told: dict[tuple[str, str], DiagnosticArray] = {}
        self._lock = threading.Lock()
        self.silent: set[str] = set()
        self.node.create_timer(0.25, self._beat)
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self.node)
        self._executor = executor
        self._thread = threading.Thread(target=executor.spin, daemon=True)
        self._thread.start()
        atexit.register(self.close)  # a spinning thread would abort the interpreter's end

    def say(self, topic: str, message: Any, profile: Any = qos.FLAG) -> None:
        """Publish once."""
        with self._lock:
            if topic not in self._publishers:
                self._publishers[topic] = self.node.create_publisher(type(message), topic, profile)
            self._publishers[topic].publish(message)

    def flag(self, valve: str, state: int, tag: str = '', **values: Any) -> None:
        """Say from now on, four times a second, how a valve is."""
        flag = FaultFlag(state=state, **{'threshold': 0.5, 'residual': 0.05, **values})
        flag.header.frame_id = tag
        with self._lock:
            self._flags[valve] = flag

    def event(self, valve: str, transition: int, tag: str = '', **values: Any) -> None:
        """Tell of a transition."""
        event = FaultEvent(transition=transition, **values)
        event.header.frame_id = tag
        event.header.stamp = self.node.get_clock().now().to_msg()
        event.onset = event.header.stamp
        self.say(_topic(valve, 'fault_event'), event, qos.EVENTS)

    def close(self) -> None:
        atexit.unregister(self.close)
        self._executor.shutdown()
        self._thread.join(5.0)
        self.node.destroy_node()
        self.context.try_shutdown()

    def _beat(self) -> None:
        stamp = self.node.get_clock().now().to_msg()
        for valve, flag in list(self._flags.items()):
            if valve not in self.silent:
                flag.header.stamp = stamp
                self.say(_topic(valve, 'fault_flag'), flag)
        for told in list(self._told.values()):
            self.say('/diagnostics', told, qos.DIAGNOSTICS)

    def diagnose(self, valve: str, node: str = 'detector', tag: str = 'actuator', **told) -> None:
        """Say from now on, once a second, what a node of a valve tells in its diagnostics."""
        status = DiagnosticStatus(name=f'{valve}/{node}: {tag}', hardware_id=tag)
        status.values = [KeyValue(key=k, value=v) for k, v in told.items()]
        with self._lock:
            self._told[valve, node] = DiagnosticArray(status=[status])


def _topic(valve: str, name: str) -> str:
    return f'/{valve}/{name}' if valve else f'/{name}'


class Site:
    """The dashboard as a process, with the voices it hears and a browser."""

    def __init__(self, folder: Path, patch: Any, arguments: list[str] | None = None) -> None:
        domain = alone(patch, folder)
        self.state = folder / 'page'
        self.voices = Voices(domain)
        self.processes = Processes(folder / 'logs', surroundings(domain))
        self.processes.__enter__()
        self.processes.forget('PYTEST_CURRENT_TEST')
        port = free_port()
        self.address = f'http://127.0.0.1:{port}'
        self._arguments = ['--port', str(port), '--state', str(self.state), *(arguments or [])]
        self.start()

    def start(self) -> None:
        self.processes.start('damadics_dashboard', 'dashboard', self._arguments)
        website.wait_until_served(self.address)

    def close(self) -> None:
        self.voices.close()
        self.processes.__exit__(None, None, None)


def fleet_messages(count: int) -> tuple[FleetLayout, FleetStatus]:
    """Make a fleet of many valves in ten areas."""
    layout = FleetLayout(version=1)
    layout.valve = [f'/unit{n % 10}/v{n:04d}' for n in range(count)]
    layout.actuator = [f'V-{n:04d}' for n in range(count)]
    layout.area = [f'Unit {n % 10}' for n in range(count)]
    status = FleetStatus(layout=1)
    status.valve = list(range(count))
    status.state = [FaultFlag.STATE_HEALTHY] * count
    status.level = [0] * count
    status.fault = [False] * count
    status.residual = [0.1] * count
    status.threshold = [1.0] * count
    status.ratio = [0.1] * count
    status.age = [0.2] * count
    status.progress = [1.0] * count
    status.since = [0] * count
    status.cause = [''] * count
    return layout, status


def now() -> int:
    return time.time_ns()


__all__ = ['Isolation', 'OperatorAction', 'Signature', 'Site', 'fleet_messages', 'serious']
