# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `detector`: residual against threshold, fault flag and events of one actuator."""

import sys
from collections.abc import Iterable
from pathlib import Path

from damadics_msgs.msg import Estimate as EstimateMessage
from damadics_msgs.msg import FaultEvent, FaultFlag, Isolation

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.detector import Detector, Outcome
from damadics_fd.core.decision.events import Decision, Event
from damadics_fd.core.judgement import Judgement, LiveJudgement
from damadics_fd.core.modes import PHASE_INIT, PHASE_MONITOR
from damadics_fd.nodes.alarm_memory import AlarmMemory
from damadics_fd.nodes.detector_report import report_of
from damadics_fd.nodes.joint import Joints, News, Outside, Taker
from damadics_fd.nodes.managed import MonitoringNode
from damadics_fd.nodes.operator import OperatorActions, OperatorServices
from damadics_fd.nodes.partial_strokes import PartialStrokes, declared_limits
from damadics_fd.nodes.second_publisher import RivalWatch
from damadics_fd.nodes.signature_publisher import SignaturePublisher, read_causes
from damadics_fd.ros import qos
from damadics_fd.ros.arguments import check_node_arguments
from damadics_fd.ros.conversions import hide, read_judgement, write_flag
from damadics_fd.ros.diagnostics import Level, Report
from damadics_fd.ros.entities import ASKED_EVERY
from damadics_fd.ros.explained import explained_messages
from damadics_fd.ros.judged_samples import JudgedSamples
from damadics_fd.ros.spin import spin
from damadics_fd.store.alarms import default_folder

DESCRIPTION = 'Judge the estimates of one valve: residual against threshold, fault flag, cause.'
EXAMPLES = """examples:
  ros2 run damadics_fd detector
  ros2 run damadics_fd detector --ros-args -p mode:=paper
  ros2 run damadics_fd detector --ros-args -r __ns:=/lv101 --params-file valve.param.yaml"""
HEARTBEAT = 1.0  # s of wall time
START_ESTIMATOR = 'start the estimator: ros2 run damadics_fd estimator'
READY = Estimate(*Estimate.rows().item())  # an estimate that makes the core compile


class DetectorNode(MonitoringNode):
    """
    Judge each estimate; publish residual, threshold and what changes; serve operators.

    :param arguments: ROS arguments of this node alone; those of the process by default.
    :param joints: with the estimators of the same process.
    """

    _taker: Taker

    def __init__(self, arguments: list[str] | None = None, joints: Joints | None = None) -> None:
        self._joints = joints or Joints()
        self.rounds = self._joints.rounds
        super().__init__('detector', 'estimate', START_ESTIMATOR, arguments)
        self._alarms = self._folder_of(self._alarm_folder)
        self._kept = self._folder_of(self._signature_folder, self._valve())
        self.check_folders(alarm_folder=self._alarms, signature_folder=self._kept)
        Detector(self.settings).update(READY)
        self._core = Detector(self.settings, self._causes.classes)
        self.start()
        self.get_logger().info(f'mode {self.settings.mode}, {self.settings.sample_rate:g} Hz')

    def declare_more(self) -> None:
        """Declare where alarms are kept."""
        self._alarm_folder = self.parameters.declare(
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
        self._stroke_limits = declared_limits(self.parameters)

    def make(self) -> None:
        """Begin afresh, with the alarms from before where they are kept."""
        made = self.entities
        self._core.reset()
        self._decision, self._judged, self._twice = None, 0, 0
        self.phase, self.last = PHASE_INIT, -1
        self._was_silent, self._looked, self._tag = True, -1e9, ''
        self._live = LiveJudgement(self._core)
        self._flag = FaultFlag()
        self._flag.header.frame_id = self.actuator
        self._samples = JudgedSamples(made, self._core)
        self._fault_flag = made.publisher(FaultFlag, 'fault_flag', qos.FLAG)
        self._fault_event = made.publisher(FaultEvent, 'fault_event', qos.EVENTS)
        self._isolation = made.publisher(Isolation, 'isolation', qos.FLAG)
        self._rival = RivalWatch(self, made, self.refuse)
        self._signature = SignaturePublisher(
            self,
            made,
            self._core.signature,
            self.actuator,
            self.settings,
            self._kept,
            self._causes.limits,
        )
        path = self._alarms / f'{self._valve()}.alarm' if self._alarms else None
        self._memory = AlarmMemory(self, self._core, path)
        if self._memory.restore():
            self._decision = self._core.decision
        self._signature.restore()
        acts = self._alarms / f'{self._valve()}.actions' if self._alarms else None
        actions = OperatorActions(self, made, self.actuator, acts)
        OperatorServices(made, actions, self._core, self._operated)
        self._strokes = PartialStrokes(
            made,
            actions,
            self._core,
            self._stroke_limits,
            lambda: self._blind,
            lambda: self._judged > 0,
            changed=lambda going: self._taker.tell_each(),
        )
        made.every(min(self.watch.timeout / 5.0, HEARTBEAT), self._look)
        made.every(HEARTBEAT, self._beat)
        self._join()
        self._publish_flag()

    def _join(self) -> None:
        """Take estimates of an estimator in this process directly; errors as from a topic."""
        source = self.watch.input(
            EstimateMessage, lambda data: self._taker.read(data), self._take, qos.SAMPLES
        )
        take = self.entities.contained('estimate', source.hand)
        hear = self.entities.contained('isolation', self._hear)
        judged = self.entities.contained('estimate', self._judged_beside)
        self._taker = Taker(take, hear, self, judged, self._samples.say)
        joint = self._joints.at(self.resolve_topic_name('estimate'))
        self.entities.on_release(joint.join(self._taker))
        self._outside = Outside(joint, self._taker, self.watch, source.subscribe)
        self._outside.look()
        if self.settings.mode == 'scada':  # there the estimator knows the cause
            self.entities.subscription(
                Isolation,
                'isolation',
                lambda message: self._hear(read_judgement(message)),
                qos.FLAG,
            )

    def _hear(self, judgement: Judgement) -> None:
        """Tell in an event what the estimator takes the fault for."""
        if self.active:
            self._tell(self._live.tell((), judgement), self._flag.header.frame_id)
            self._decision = self._core.decision if self._decision else None

    def _folder_of(self, given: str, own: str = '') -> Path | None:
        """Return the folder that a parameter means; `own` is the part of this valve in `auto`."""
        if not given or (given == 'auto' and self.settings.mode == 'paper'):
            return None
        return default_folder() / own if given == 'auto' else Path(given).expanduser()

    def _valve(self) -> str:
        return self.get_namespace().strip('/').replace('/', '__') or 'root'

    def _take(self, estimate: Estimate, tag: str) -> None:
        before, decision = self._decision, self._judge(estimate)
        if decision is None:
            return
        self._decision = decision
        self._publish(tag, before is None or decision.shown != before.shown)
        if decision.transitions:
            self._happened(tag)
        self._signature.update(decision.stamp, tag)
        self._strokes.follow(estimate, tag)

    def _judge(self, estimate: Estimate) -> Decision | None:
        """Judge an estimate; None where it is not to be judged."""
        if not self.active:
            return None
        self._memory.begin(estimate.stamp)
        self._signature.begin(estimate.stamp)
        if self._judged and estimate.stamp == self.last:
            self._twice += 1  # two estimators send
            return None
        learns = self.phase == PHASE_MONITOR and estimate.phase < PHASE_MONITOR
        if learns and not self._was_silent:
            self._core.signature.relearn()  # somebody had the valve learned afresh
        self.phase, self.last = estimate.phase, estimate.stamp
        self._judged += 1
        return self._core.update(estimate)

    def _judged_beside(self, stamp: int, tag: str, news: News) -> None:
        """Publish what an estimator of this process has had judged, an ordinary estimate."""
        taker = self._taker
        taker.ordinary += 1
        self._settle()
        self.last, self.unread = stamp, True
        moved = tag != self._tag
        taker.speaks = self._samples.heard
        if any(news) or moved or self._was_silent or taker.speaks:
            self._publish(tag, news.shown)
            if news.happened:
                self._happened(tag)
        if news.signed or self._signature.due(stamp):
            self._signature.update(stamp, tag)
        if moved or self._strokes.under_way:
            self._strokes.follow(self._core.estimate, tag)
        if self._was_silent or self._strokes.under_way:
            taker.tell_each()
        else:
            taker.rest(self.watch.wall + ASKED_EVERY, tag, self._signature.told)

    def _settle(self) -> None:
        """Count the samples of which the estimator beside had nothing to tell."""
        taker = self._taker
        if taker.ordinary:
            self._judged += taker.ordinary
            taker.ordinary = 0
            self.watch.heard_beside(taker.watch)

    @property
    def core(self) -> Detector:
        """The detector."""
        return self._core

    @property
    def _decision(self) -> Decision | None:  # read where it is needed
        if self.unread:
            self._decision = self._core.decision
        return self._known

    @_decision.setter
    def _decision(self, decision: Decision | None) -> None:
        self._known, self.unread = decision, False

    def _publish(self, tag: str, changed: bool) -> None:
        """Publish residual and threshold to who listens, and the flag where it has changed."""
        if self._tag != tag:
            self._tag = self._flag.header.frame_id = tag
        if self._samples.heard and (decision := self._decision):
            self._samples.publish(decision, tag)
        silent = self._was_silent and self.watch.wall >= self._looked + ASKED_EVERY
        turned = silent and self._look()
        if changed and not turned:
            self._publish_flag()
            self.diagnostics.check()

    def _happened(self, tag: str) -> None:
        """Tell the transitions of the latest decision, and keep the alarm for a restart."""
        if decision := self._decision:
            self._tell(self._live.tell(decision.events), tag)
            self._decision = self._core.decision

    def _tell(self, events: Iterable[Event], frame_id: str, more: str = '') -> None:
        for event in events:
            own = bool(self._core.signature.state[0].own)
            message, isolation = explained_messages(
                event, self._causes, self.actuator, frame_id, own, more
            )
            self._fault_event.publish(message)
            if isolation and self.settings.mode != 'scada':  # there the estimator tells it
                self._isolation.publish(isolation)
        self._memory.keep()

    @property
    def _blind(self) -> bool:
        """Whether the latest judgement says nothing about now."""
        self._settle()
        return (
            not self.active
            or self.watch.silent
            or self.watch.stale
            or self.entities.fails('estimate')
        )

    def _look(self) -> bool:
        """Turn to "not monitoring" when the input falls silent or behind, and back."""
        self._looked = self.watch.wall
        turned = self._was_silent != self._blind
        if turned:
            self._was_silent = not self._was_silent
            self._taker.tell_each()
            if self._was_silent:
                self._strokes.end('the valve is not seen any more')
            self._publish_flag()
            self.diagnostics.check()
        return turned

    def _beat(self) -> None:
        if self._memory.problem:
            self._memory.keep()
        self._outside.look()
        self._publish_flag()

    def _publish_flag(self) -> None:
        flag = self._flag
        if self._decision is not None:
            write_flag(self._decision, flag)
        if self._blind:
            hide(flag)
        self._fault_flag.publish(flag)
        self._rival.sent()

    def _operated(self, outcome: Outcome, remark: str) -> None:
        self._decision = self._core.decision
        self._publish_flag()
        self._tell(outcome.events, self._flag.header.frame_id, remark)
        self.diagnostics.publish()

    def report(self) -> Report:
        """Say what is judged."""
        self._settle()
        decision = self._decision
        more = self.commissioned | self._strokes.values
        if decision is None:
            return Level.ERROR, 'no estimate has arrived', more
        return report_of(
            decision,
            self._core,
            self._memory,
            self._signature,
            judged=self._judged,
            twice=self._twice,
            rival=self._rival.problem,
            silent=self.watch.silent,
            more=more,
        )


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    check_node_arguments('detector', DESCRIPTION, EXAMPLES, args)
    return spin(DetectorNode, args)


if __name__ == '__main__':
    sys.exit(main())
