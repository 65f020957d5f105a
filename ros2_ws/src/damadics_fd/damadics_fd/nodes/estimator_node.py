# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `estimator`: velocity and on-line approximator of one actuator."""

import math
import sys
import time
from pathlib import Path
from typing import Any

from damadics_msgs.msg import Estimate as EstimateMessage
from damadics_msgs.msg import Measurement
from damadics_msgs.srv import Reference as ReferenceService
from damadics_msgs.srv import Relearn
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from damadics_fd.core.decision.alarm import NE107
from damadics_fd.core.quality import EXPLANATIONS
from damadics_fd.core.scada.estimator import estimator_for
from damadics_fd.nodes.managed import MonitoringNode
from damadics_fd.nodes.operator import signed
from damadics_fd.ros import qos
from damadics_fd.ros.arguments import check_node_arguments
from damadics_fd.ros.conversions import sample, write_estimate
from damadics_fd.ros.diagnostics import Level, Report
from damadics_fd.ros.spin import spin
from damadics_fd.store.references import (
    NoReferenceError,
    Reference,
    load_reference,
    save_reference,
)

DESCRIPTION = 'Estimate velocity and residual of one valve with the on-line approximator.'
EXAMPLES = """examples:
  ros2 run damadics_fd estimator
  ros2 run damadics_fd estimator --ros-args -p mode:=paper
  ros2 run damadics_fd estimator --ros-args -r __ns:=/lv101 --params-file valve.param.yaml"""
START_PLANT = 'start a driver of the valve, or the simulator: ros2 run damadics_plant plant'
READY = (1, 0.5, 0.5, 0.0, 0.0, 20.0, 0.0, 0.0)  # a sample that makes the core compile
MONITORING = ('monitor', 'paper')  # phases in which decisions count
RECENT = 1.5  # s of wall time for which a refused sample is told


class EstimatorNode(MonitoringNode):
    """Turn each measurement into an estimate; report what was refused; keep what was learned."""

    def __init__(self, arguments: list[str] | None = None) -> None:
        super().__init__('estimator', 'measurement', START_PLANT, arguments)
        estimator_for(self.settings).update(*READY)
        self._core = estimator_for(self.settings)
        self._message = EstimateMessage()
        self._last = self._core.phase
        self._refused_at = -math.inf  # monotonic time of the last refused sample [s]
        self._publisher = self.create_publisher(EstimateMessage, 'estimate', qos.SAMPLES)
        self.create_service(Relearn, 'relearn', self._relearn)
        self.create_service(ReferenceService, 'save_reference', self._save_service)
        self.create_service(ReferenceService, 'load_reference', self._load_service)
        self.watch.subscribe(Measurement, self._take, qos.SAMPLES)
        self.start()
        self.get_logger().info(f'mode {self.settings.mode}, {self.settings.sample_rate:g} Hz')

    def declare_more(self) -> None:
        """Declare where the reference is kept."""
        self._path = self.parameters.declare(
            'reference',
            '',
            'file with what was learned, without ".a.json"; loaded at the start, '
            'written when learning ends; "": learn at every start',
        )

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin afresh, with the reference where there is one."""
        self._core.reset()
        if self._path:
            done, text = self._load(self._path)
            (self.get_logger().info if done else self.get_logger().warning)(text)
        return super().on_configure(state)

    def _take(self, measurement: Measurement) -> None:
        if not self.active:
            return
        estimate = self._core.update(*sample(measurement))
        if estimate is None:
            self._refused_at = time.monotonic()
            self.diagnostics.check()
            return
        write_estimate(estimate, self._message)
        self._message.header.frame_id = measurement.header.frame_id
        self._publisher.publish(self._message)
        phase = self._core.phase
        if phase != self._last:
            learned = phase == 'monitor' and self._last.startswith('learn')
            self._last = phase
            self.diagnostics.check()
            if learned and self._path:
                self.get_logger().info(self._save(self._path, 'live')[1])

    def _save(self, path: str, source: str) -> tuple[bool, str]:
        try:
            reference = Reference(
                self.actuator,
                self._core.learned(),
                self.settings.to_dict(),
                source=source,
                last_stamp=int(self._core.quality[0].stamp),
            )
            return True, f'reference saved: {save_reference(Path(path).expanduser(), reference)}'
        except (ValueError, OSError) as problem:
            return False, f'reference not saved: {problem}'

    def _load(self, path: str) -> tuple[bool, str]:
        try:
            reference = load_reference(Path(path).expanduser(), self.actuator, self.settings)
            self._core.restore(reference.learned)
        except NoReferenceError as problem:
            return False, f'no reference, the valve is learned: {problem}'
        except ValueError as problem:
            return False, f'reference refused, the valve is learned: {problem}'
        return True, f'reference loaded: {path}, {reference.source}'

    def _save_service(self, request: Any, response: Any) -> Any:
        done = self._of_path(request, lambda path: self._save(path, 'live'))
        response.success, response.message = done
        return response

    def _load_service(self, request: Any, response: Any) -> Any:
        response.success, response.message = self._of_path(request, self._load)
        self.diagnostics.publish()
        return response

    def _of_path(self, request: Any, act: Any) -> tuple[bool, str]:
        path = request.path or self._path
        if not path:
            return False, 'no file: give path, or set the parameter reference'
        done, text = act(path)
        self.get_logger().info(text)
        return done, text

    def _relearn(self, request: Any, response: Any) -> Any:
        if self.settings.mode == 'paper':
            response.message = 'mode paper learns all the time: there is nothing to learn anew'
            return response
        self._core.relearn(after_repair=True)
        response.success, response.message = True, 'learning anew: faults are not reported'
        self.get_logger().info(response.message + signed(request.user, request.comment))
        self.diagnostics.publish()
        return response

    def report(self) -> Report:
        """Say what the estimator does, and what it refused."""
        counters = self._core.counters
        good = self._core.phase in MONITORING
        failed = self._core.failed_input
        values = {
            'NE 107': self._class_of(failed, good),
            'Phase': self._core.phase,
            'Learning progress (%)': 100.0 * self._message.progress,
            'Last refused': self._core.last_rejection or 'none',
            **{f'Samples {name.replace("_", " ")}': count for name, count in counters.items()},
        }
        if self.watch.silent:
            return Level.ERROR, 'no measurement arrives', values
        if failed:
            return Level.ERROR, f'not monitored, the input has failed: {failed}', values
        if time.monotonic() - self._refused_at < RECENT:
            reason = self._core.last_rejection.split(':')[0]
            return Level.WARN, f'samples refused: {EXPLANATIONS[reason]}', values
        return Level.OK if good else Level.WARN, self._core.status, values

    def _class_of(self, failed: str, good: bool) -> str:
        if failed:
            return NE107[2 if failed.startswith('out_of_range') else 4]
        return NE107[0 if good else 3]


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    check_node_arguments('estimator', DESCRIPTION, EXAMPLES, args)
    return spin(EstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
