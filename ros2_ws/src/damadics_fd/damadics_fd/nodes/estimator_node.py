# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `estimator`: velocity and on-line approximator of one actuator."""

import math
import sys
import time
from pathlib import Path

from damadics_msgs.msg import Estimate as EstimateMessage
from damadics_msgs.msg import Isolation, Measurement, OperatorAction
from damadics_msgs.srv import Relearn

from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.bank.pair import ESTIMATED, HAPPENED, REFUSED, SHOWN, SIGNED, Pair
from damadics_fd.core.decision.alarm import (
    FAILURE,
    FUNCTION_CHECK,
    NE107,
    NORMAL,
    OUT_OF_SPECIFICATION,
)
from damadics_fd.core.estimating import estimator_for
from damadics_fd.core.judgement import Judgement
from damadics_fd.core.quality import Reason, Refused
from damadics_fd.core.sample import Sample
from damadics_fd.nodes.frozen_position import FrozenPosition
from damadics_fd.nodes.joint import Beside, Joints, News, Taker
from damadics_fd.nodes.managed import MonitoringNode
from damadics_fd.nodes.operator import OperatorActions
from damadics_fd.nodes.reference_keeper import ReferenceKeeper
from damadics_fd.ros import qos
from damadics_fd.ros.arguments import check_node_arguments
from damadics_fd.ros.conversions import judgement_message
from damadics_fd.ros.diagnostics import Level, Report
from damadics_fd.ros.raw import EstimateEncoder, SampleReader
from damadics_fd.ros.spin import spin

DESCRIPTION = 'Estimate velocity and residual of one valve with the on-line approximator.'
EXAMPLES = """examples:
  ros2 run damadics_fd estimator
  ros2 run damadics_fd estimator --ros-args -p mode:=paper
  ros2 run damadics_fd estimator --ros-args -r __ns:=/lv101 --params-file valve.param.yaml"""
START_PLANT = 'start a driver of the valve, or the simulator: ros2 run damadics_plant plant'
READY = (1, 0.5, 0.5, 0.0, 0.0, 20.0, 0.0, 0.0)  # a sample that makes the core compile
RECENT = 1.5  # s of wall time for which a refused sample is told


class EstimatorNode(MonitoringNode):
    """
    Turn each measurement into an estimate; report what was refused; keep what was learned.

    :param arguments: ROS arguments of this node alone; those of the process by default.
    :param joints: with the detectors of the same process.
    """

    def __init__(self, arguments: list[str] | None = None, joints: Joints | None = None) -> None:
        self._joints = joints or Joints()
        self.rounds = self._joints.rounds
        super().__init__('estimator', 'measurement', START_PLANT, arguments)
        self.check_folders(reference=self._path.parent if self._path else None)
        estimator_for(self.settings).update(*READY)
        self._core = estimator_for(self.settings)
        self.start()
        self.get_logger().info(f'mode {self.settings.mode}, {self.settings.sample_rate:g} Hz')

    def declare_more(self) -> None:
        """Declare where the reference is kept."""
        path = self.parameters.declare(
            'reference',
            '',
            'file with what was learned, without ".a.json"; loaded at the start, '
            'written when learning ends; "": learn at every start',
        )
        self._path = Path(path).expanduser().absolute() if path else None

    def make(self) -> None:
        """Begin afresh, with the reference where there is one."""
        made = self.entities
        self._core.reset()
        self._encoder = EstimateEncoder()
        self._joint = self._joints.at(self.resolve_topic_name('estimate'))
        self._pair: tuple[Taker, Pair | None] | None = None
        self._heard = False  # others listen to the estimates, when asked last
        self._last, self._phase = self._core.phase, -1
        self._refused_at = -math.inf  # monotonic time of the last refused sample [s]
        self._frozen = FrozenPosition()
        self._send, self._listeners = made.publisher_on_request(
            EstimateMessage, 'estimate', qos.SAMPLES
        )
        made.on_release(self._joint.enter())
        self._judgement: Judgement | None = None
        if self._core.stride:
            self._isolation = made.publisher(Isolation, 'isolation', qos.FLAG)
        acts = self._path.with_name(f'{self._path.name}.actions') if self._path else None
        self._actions = OperatorActions(self, made, self.actuator, acts)
        made.service(Relearn, 'relearn', self._relearn)
        self._reference = ReferenceKeeper(
            self, made, self._actions, self._core, self.actuator, self.settings, self._path
        )
        self._reference.restore()
        self.watch.input(Measurement, SampleReader(), self._take, qos.SAMPLES).subscribe()

    def _take(self, sample: Sample, tag: str) -> None:
        if not self.active:
            return
        self._frozen.waiting.append(sample)
        taker = self._joint.only
        if taker is not None and (beside := taker.beside) is not None and beside.active:
            made = self._pair
            if made is None or made[0] is not taker:
                made = self._pair_with(taker, beside)
            if pair := made[1]:
                known = self._phase if self._phase == beside.phase else -1
                news = pair.take(sample, known, beside.last)
                if (
                    news == 0
                    and self.watch.wall < taker.until
                    and taker.first <= sample.stamp < taker.end
                    and tag == taker.tag
                ):  # as nearly always: there is nothing to tell
                    beside.last, beside.unread = sample.stamp, True
                    taker.ordinary += 1
                    if self._heard:
                        self._publish(sample.stamp, tag, taker)
                    if taker.speaks:
                        taker.say(tag)
                    return
                estimate = self._judged_at_once(sample, tag, taker, news)
                if estimate is None:
                    return
            else:
                estimate = self._core.update(*sample)
        else:
            estimate = self._core.update(*sample)
        if isinstance(estimate, Refused):
            self._refused_at = time.monotonic()
            self.diagnostics.check()
            return
        self._tell_judgement(tag)  # first, for the alarm that the estimate may raise
        self._give(estimate, tag)
        if estimate.phase == self._phase:
            return
        self._phase, phase = estimate.phase, self._core.phase
        if phase != self._last:
            learned = phase == 'monitor' and self._last.startswith('learn')
            self._last = phase
            self.diagnostics.check()
            if learned:
                self._reference.keep()

    def _pair_with(self, taker: Taker, beside: Beside) -> tuple[Taker, Pair | None]:
        """Join with the only detector beside, where the mode lets it judge with the sample."""
        core = self._core
        taker.watch = self.watch
        self._pair = taker, Pair(core, beside.core) if isinstance(core, Estimator) else None
        return self._pair

    def _judged_at_once(
        self, sample: Sample, tag: str, taker: Taker, news: int
    ) -> Estimate | Refused | None:
        """Tell what the detector has judged with the sample; None where it has."""
        core = self._core
        assert isinstance(core, Estimator)
        if news >= 0:
            self._heard = self._listeners.count > taker.subscribed
            if self._heard:
                self._publish(sample.stamp, tag, taker)
            bits = (HAPPENED, SHOWN, SIGNED)
            taker.judged(sample.stamp, tag, News(*(bool(news & bit) for bit in bits)))
            return None
        if news == ESTIMATED:
            return core.latest
        return core.note(REFUSED - news, sample.stamp, sample[1:], core.last_stamp)

    def _publish(self, stamp: int, tag: str, taker: Taker) -> None:
        """Publish the latest estimate, which the detector beside has judged."""
        core = self._core
        assert isinstance(core, Estimator)
        taker.sent(stamp)
        self._send(self._encoder.encode(core.latest, tag))

    def _give(self, estimate: Estimate, tag: str) -> None:
        """Hand an estimate to the detector beside, and publish it for whoever else listens."""
        takers = self._joint.takers
        if not takers or self._joint.heard(self._listeners.count):
            for taker in takers:
                taker.sent(estimate.stamp)
            self._send(self._encoder.encode(estimate, tag))
        self._joint.hand(estimate, tag)

    def _tell_judgement(self, tag: str) -> None:
        """Publish what a fault is taken for, where this estimator judges that, when it changes."""
        judgement = self._core.judgement
        if judgement is not None and judgement is not self._judgement:
            self._judgement = judgement
            self._isolation.publish(judgement_message(judgement, tag))
            self._joint.tell(judgement)

    def _relearn(self, request: Relearn.Request, response: Relearn.Response) -> Relearn.Response:
        if self.settings.mode == 'paper':
            response.message = 'mode paper learns all the time: there is nothing to learn anew'
        else:
            self._core.relearn(after_repair=True)
            response.success, response.message = True, 'learning anew: faults are not reported'
        self._actions.tell(
            OperatorAction.RELEARN,
            response.success,
            response.message,
            stamp=self._core.last_stamp,
            user=request.user,
            comment=request.comment,
        )
        self.diagnostics.publish()
        return response

    def report(self) -> Report:
        """Say what the estimator does, and what it refused."""
        counters = self._core.counters
        good = self._core.monitoring
        failed, failing = self._core.failed_input, self._core.failing
        frozen = self._frozen.problem
        values = {
            'NE 107': self._class_of(failing, good),
            'Phase': self._core.phase,
            'Learning progress (%)': 100.0 * (self._progress if counters['accepted'] else 0.0),
            'Last refused': self._core.last_rejection or 'none',
            **{f'Samples {name.replace("_", " ")}': count for name, count in counters.items()},
        }
        if self.watch.silent:
            return Level.ERROR, 'no measurement arrives', values
        if failed:
            return Level.ERROR, f'not monitored, the input has failed: {failed}', values
        if time.monotonic() - self._refused_at < RECENT:
            explanation = self._core.refused.explanation if self._core.refused else ''
            return Level.WARN, f'samples refused: {explanation}', values
        if self._reference.problem:
            return Level.WARN, self._reference.problem, values
        if good and frozen:
            return Level.WARN, frozen, values
        return Level.OK if good else Level.WARN, self._core.status, values

    @property
    def _progress(self) -> float:
        core = self._core
        return core.latest.progress if isinstance(core, Estimator) else core.progress

    def _class_of(self, failing: Refused | None, good: bool) -> str:
        if failing:
            outside = failing.reason == Reason.OUT_OF_RANGE
            return NE107[OUT_OF_SPECIFICATION if outside else FAILURE]
        return NE107[NORMAL if good else FUNCTION_CHECK]


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    check_node_arguments('estimator', DESCRIPTION, EXAMPLES, args)
    return spin(EstimatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
