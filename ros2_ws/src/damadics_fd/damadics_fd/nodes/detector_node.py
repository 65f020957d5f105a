# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `detector`: residual against threshold, fault flag and events of one actuator."""

import sys
from pathlib import Path
from typing import Any

from damadics_msgs.msg import Estimate as EstimateMessage
from damadics_msgs.msg import FaultEvent, FaultFlag, Float64Stamped
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn

from damadics_fd.causes import explain
from damadics_fd.core.approximator.estimator import Estimate
from damadics_fd.core.decision.alarm import NE107
from damadics_fd.core.decision.detector import Decision, Detector, Outcome
from damadics_fd.core.modes import PHASE_INIT, PHASE_MONITOR
from damadics_fd.core.stamps import another_run
from damadics_fd.nodes.managed import MonitoringNode
from damadics_fd.nodes.operator import OperatorServices
from damadics_fd.nodes.second_publisher import RivalWatch
from damadics_fd.nodes.signature_publisher import SignaturePublisher, read_causes
from damadics_fd.ros import qos
from damadics_fd.ros.arguments import check_node_arguments
from damadics_fd.ros.conversions import event_message, read_estimate, write_flag
from damadics_fd.ros.diagnostics import Level, Report
from damadics_fd.ros.spin import spin
from damadics_fd.store.alarms import AlarmStore, default_folder

DESCRIPTION = 'Judge the estimates of one valve: residual against threshold, fault flag, cause.'
EXAMPLES = """examples:
  ros2 run damadics_fd detector
  ros2 run damadics_fd detector --ros-args -p mode:=paper
  ros2 run damadics_fd detector --ros-args -r __ns:=/lv101 --params-file valve.param.yaml"""
HEARTBEAT = 1.0  # s of wall time
START_ESTIMATOR = 'start the estimator: ros2 run damadics_fd estimator'
READY = Estimate._make([1] + [0.0] * 14 + [0])  # an estimate that makes the core compile


class DetectorNode(MonitoringNode):
    """Judge each estimate; publish residual, threshold and what changes; serve operators."""

    def __init__(self, arguments: list[str] | None = None) -> None:
        super().__init__('detector', 'estimate', START_ESTIMATOR, arguments)
        Detector(self.settings).update(READY)
        self._core = Detector(self.settings, self._causes.classes)
        self._decision: Decision | None = None
        self._loaded: int | None = None  # stamp of the alarm state that was loaded
        self._judged = self._twice = 0
        self._phase = PHASE_INIT
        self._number = Float64Stamped()
        self._flag = FaultFlag()
        self._residual = self.create_publisher(Float64Stamped, 'residual', qos.SAMPLES)
        self._threshold = self.create_publisher(Float64Stamped, 'threshold', qos.SAMPLES)
        self._fault_flag = self.create_publisher(FaultFlag, 'fault_flag', qos.FLAG)
        self._fault_event = self.create_publisher(FaultEvent, 'fault_event', qos.EVENTS)
        self._rival = RivalWatch(self, self.refuse)
        self._signature = SignaturePublisher(
            self,
            self._core.signature,
            self.actuator,
            self.settings,
            self._folder_of(self._signature_folder, self._valve()),
            self._causes.limits,
        )
        OperatorServices(self, self._core, self._operated)
        self._was_silent = True
        self.start()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(min(self.watch.timeout / 5.0, HEARTBEAT), self._look, clock=steady)
        self.create_timer(HEARTBEAT, self._publish_flag, clock=steady)
        self.watch.subscribe(EstimateMessage, self._take, qos.SAMPLES)
        self._publish_flag()
        self.get_logger().info(f'mode {self.settings.mode}, {self.settings.sample_rate:g} Hz')

    def declare_more(self) -> None:
        """Declare where alarms are kept."""
        self._folder = self.parameters.declare(
            'alarm_folder',
            'auto',
            'folder that keeps the alarms over a restart; "auto": one of '
            'the user, in mode paper none; "": none',
        )
        self._causes = read_causes(
            self.parameters.declare(
                'causes_file', '', 'YAML file with texts and advice per cause; "": the own ones'
            )
        )
        self._signature_folder = self.parameters.declare(
            'signature_folder',
            'auto',
            'folder that keeps signature and trends over a restart; '
            '"auto": beside the alarms, in mode paper none; "": none',
        )

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin afresh, with the alarms from before where they are kept."""
        self._core.reset()
        self._store = self._make_store()
        try:
            saved = self._store.load() if self._store else None
            if saved is not None:
                self._core.load(saved)
                self._decision = self._core.decision
                self._loaded = int(saved['stamp'])
                self.get_logger().info(f'alarms of before taken up from {self._store.path}')
        except ValueError as problem:
            self.get_logger().error(f'alarms of before are lost: {problem}')
        self._signature.restore()
        return super().on_configure(state)

    def _make_store(self) -> AlarmStore | None:
        folder = self._folder_of(self._folder)
        return AlarmStore(folder / f'{self._valve()}.alarm.json') if folder else None

    def _folder_of(self, given: str, own: str = '') -> Path | None:
        """Return the folder that a parameter means; `own` is the part of this valve in `auto`."""
        if not given or (given == 'auto' and self.settings.mode == 'paper'):
            return None
        return default_folder() / own if given == 'auto' else Path(given).expanduser()

    def _valve(self) -> str:
        return self.get_namespace().strip('/').replace('/', '__') or 'root'

    def _take(self, message: EstimateMessage) -> None:
        if not self.active:
            return
        estimate = read_estimate(message)
        before = self._decision
        if self._loaded is not None:
            if another_run(self._loaded, estimate.stamp):
                self.get_logger().info('time begins anew: the alarms belong to another run')
                self._core.reset()
            self._loaded = None
        elif before is not None and estimate.stamp == before.stamp:
            self._twice += 1  # two estimators send
            return
        self._signature.begin(estimate.stamp)
        learns = self._phase == PHASE_MONITOR and estimate.phase < PHASE_MONITOR
        if learns and not self._was_silent:
            self._core.signature.relearn()  # somebody had the valve learned afresh
        self._phase = estimate.phase
        decision = self._decision = self._core.update(estimate)
        self._judged += 1
        header = message.header
        self._number.header = self._flag.header = header
        self._number.data = decision.residual
        self._residual.publish(self._number)
        self._number.data = decision.threshold
        self._threshold.publish(self._number)
        if before is None or self._was_silent or decision[5:8] != before[5:8]:
            self._was_silent = False
            self._publish_flag()
            self.diagnostics.check()
        if decision.events:
            self._tell(decision.events, header.frame_id)
        self._signature.update(header, decision.stamp)

    def _tell(self, events: Any, frame_id: str, more: str = '') -> None:
        """Publish transitions, and keep the alarm for a restart."""
        for event in events:
            message = event_message(explain(event, self._causes, self.actuator), frame_id)
            message.text += more
            self._fault_event.publish(message)
        if self._store:
            try:
                self._store.save(self._core.save())
            except OSError as problem:
                self.get_logger().error(
                    f'the alarm would not survive a restart: {problem}', throttle_duration_sec=60.0
                )

    def _look(self) -> None:
        """Turn to "not monitoring" when the input falls silent."""
        if not self._was_silent and (self.watch.silent or not self.active):
            self._was_silent = True
            self._publish_flag()
            self.diagnostics.check()

    def _publish_flag(self) -> None:
        if self._decision is not None:
            write_flag(self._decision, self._flag)
        if self.watch.silent or not self.active:
            self._flag.state = FaultFlag.STATE_NOT_MONITORING
            self._flag.level = self._flag.level or FaultFlag.NE107_FUNCTION_CHECK
        self._fault_flag.publish(self._flag)
        self._rival.sent()

    def _operated(self, outcome: Outcome, remark: str) -> None:
        self._decision = self._core.decision
        self._publish_flag()
        self._tell(outcome.events, self._flag.header.frame_id, remark)
        self.diagnostics.publish()

    def report(self) -> Report:
        """Say what is judged."""
        decision = self._decision
        if decision is None:
            return Level.ERROR, 'no estimate has arrived', {}
        statistics = self._core.statistics
        values = {
            'Fault': decision.fault,
            'Residual (1/s)': decision.residual,
            'Threshold (1/s)': decision.threshold,
            'Faults since the start': decision.occurrence,
            'Acknowledged': decision.acknowledged,
            'Near misses': statistics['near_misses'],
            'Chatter': bool(statistics['chatter']),
            'Estimates judged': self._judged,
            'Estimates received twice': self._twice,
            'NE 107': NE107[decision.level],
            **self._signature.values,
        }
        if self.watch.silent:
            return Level.ERROR, 'estimates have stopped: not monitoring', values
        if decision.fault:
            return Level.ERROR, f'fault {decision.occurrence} flagged', values
        if self._twice:
            return Level.WARN, 'estimates arrive twice: end one of the estimators', values
        if decision.level:
            return Level.WARN, f'{NE107[decision.level]}: no faults are reported', values
        return Level.OK, 'no fault flagged', values


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    check_node_arguments('detector', DESCRIPTION, EXAMPLES, args)
    return spin(DetectorNode, args)


if __name__ == '__main__':
    sys.exit(main())
