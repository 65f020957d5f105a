# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
A detector of the test: publishes flags and events as the real one does, serves its services.

As a program, `detectors.py VALVE ...`, it judges what it is told: "raised VALVE", "cleared VALVE".
"""

import atexit
import os
import sys
import threading
import time

import rclpy
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultEvent, FaultFlag
from damadics_msgs.srv import Acknowledge, PartialStroke, ResetAlarm, Shelve
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

NANO = 10**9


class Detectors:
    """Detectors of several valves in one node, in a thread of their own."""

    def __init__(self, domain: int, *valves: str) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node('detectors', context=self.context)
        self.calls: list[tuple] = []
        self.flags = {}
        self._topics = {}
        self._frozen: set[str] = set()
        for valve in valves:
            self._topics[valve] = (
                self.node.create_publisher(FaultFlag, f'/{valve}/fault_flag', qos.FLAG),
                self.node.create_publisher(FaultEvent, f'/{valve}/fault_event', qos.EVENTS),
            )
            self.flags[valve] = FaultFlag(state=FaultFlag.STATE_HEALTHY, residual=0.1)
            self.flags[valve].threshold = 1.0
            self.flags[valve].header.frame_id = valve.upper()
            for kind, name in ((Acknowledge, 'acknowledge'), (ResetAlarm, 'reset')):
                self._serve(kind, valve, name)
            self._serve(Shelve, valve, 'shelve')
            self._serve(PartialStroke, valve, 'partial_stroke')
        self.strokes: list[tuple] = []
        self.node.create_timer(0.3, self._repeat)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        atexit.register(self.close)  # a spinning thread would abort the interpreter's end

    def judge(self, valve: str, transition: int, text: str = '', **fields) -> int:
        """Publish a transition and the flag that goes with it; return its stamp."""
        flag = self.flags[valve]
        event = FaultEvent(transition=transition, text=text)
        stamp = time.time_ns()
        event.header.frame_id = valve.upper()
        event.header.stamp.sec, event.header.stamp.nanosec = divmod(stamp, NANO)
        if transition == FaultEvent.RAISED:
            flag.fault, flag.state, flag.residual = True, FaultFlag.STATE_ALARM, 2.0
            flag.level = FaultFlag.NE107_OUT_OF_SPECIFICATION
            flag.occurrence += 1
        elif transition == FaultEvent.CLEARED:
            flag.fault, flag.state = False, FaultFlag.STATE_LATCHED
        elif transition == FaultEvent.RESET:
            flag.state, flag.level, flag.residual = FaultFlag.STATE_HEALTHY, 0, 0.1
        event.occurrence, event.level = flag.occurrence, flag.level
        event.residual, event.threshold, event.ratio = flag.residual, 1.0, flag.residual
        for name, value in fields.items():
            setattr(event, name, value)
        self._topics[valve][1].publish(event)
        self._repeat()
        return stamp

    def freeze(self, valve: str, frozen: bool = True) -> None:
        """Go on repeating the flag of a valve with the stamp that it has, or end that."""
        (self._frozen.add if frozen else self._frozen.discard)(valve)

    def silence(self) -> None:
        """Stop repeating the flags, as detectors that have died."""
        self.flags = {}

    def __enter__(self) -> 'Detectors':
        return self

    def __exit__(self, *problem: object) -> None:
        self.close()

    def close(self) -> None:
        atexit.unregister(self.close)
        self._stop.set()
        self._thread.join(5.0)
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def _spin(self) -> None:
        while not self._stop.is_set():
            self.executor.spin_once(timeout_sec=0.1)

    def _repeat(self) -> None:
        for valve, flag in self.flags.items():
            if valve not in self._frozen:
                flag.header.stamp.sec, flag.header.stamp.nanosec = divmod(time.time_ns(), NANO)
            self._topics[valve][0].publish(flag)

    def _serve(self, kind, valve: str, name: str) -> None:
        def answer(request, response):
            self.calls.append((valve, name, request.user, request.comment))
            if name == 'partial_stroke':
                self.strokes.append((valve, request.amplitude, request.count))
            response.success = name != 'reset'
            response.message = f'{name} of {valve}'
            if name == 'acknowledge':
                self.judge(valve, FaultEvent.ACKNOWLEDGED)
            return response

        self.node.create_service(kind, f'/{valve}/{name}', answer)


if __name__ == '__main__':
    told = Detectors(int(os.environ['ROS_DOMAIN_ID']), *sys.argv[1:])
    for line in sys.stdin:
        transition, name = line.split()
        told.judge(name, getattr(FaultEvent, transition.upper()), f'{transition} {name}')
