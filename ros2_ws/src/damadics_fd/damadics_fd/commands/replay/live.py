# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Publish a recording on the topics of the live system, with /clock and at any speed."""

import sys
import time
from collections.abc import Iterator, Sequence

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from damadics_msgs.msg import Estimate as EstimateMessage
from damadics_msgs.msg import (
    FaultEvent,
    FaultFlag,
    FaultState,
    Float64Stamped,
    Isolation,
    Measurement,
)
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from tqdm import tqdm

from damadics_fd.bag.arrays import Columns
from damadics_fd.bag.checking.inspection import LOSSY
from damadics_fd.bag.recording import Recording
from damadics_fd.causes import explain, load_causes
from damadics_fd.commands.replay.bags import Plan, joined
from damadics_fd.commands.replay.flags import frame_id
from damadics_fd.core.judgement import Judgement, LiveJudgement
from damadics_fd.core.monitor import Chain
from damadics_fd.core.quality import Refused
from damadics_fd.core.sample import SIGNALS, Sample
from damadics_fd.nodes.signature_publisher import SignaturePublisher
from damadics_fd.ros import qos
from damadics_fd.ros.conversions import (
    event_message,
    header_of,
    judgement_message,
    set_stamp,
    write_flag,
)
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.raw import Encoder, EstimateEncoder
from damadics_fd.ros.spin import FINISHING, let_subscribers_take

CLOCK_PERIOD = 0.01  # [s] of wall time between two messages on /clock
HEARTBEAT = 10**9  # [ns] of scenario time between two flags without change
DISCOVERY = 3.5  # [s] without a new subscriber before the first sample; DDS announces every 3 s


class Judgements:
    """
    Publish what estimator and detector say of a recording, as their nodes do.

    :param node: publishes.
    :param monitor: of the mode.
    :param tag: of the actuator.
    """

    def __init__(self, node: Node, monitor: Chain, tag: str) -> None:
        self._monitor = monitor
        self._causes = load_causes()
        self._tag = tag
        self._estimates, self._numbers = EstimateEncoder(), Encoder()
        self._estimate = node.create_publisher(EstimateMessage, 'estimate', qos.SAMPLES)
        self._residual = node.create_publisher(Float64Stamped, 'residual', qos.SAMPLES)
        self._threshold = node.create_publisher(Float64Stamped, 'threshold', qos.SAMPLES)
        self._flag = node.create_publisher(FaultFlag, 'fault_flag', qos.FLAG)
        self._event = node.create_publisher(FaultEvent, 'fault_event', qos.EVENTS)
        self._signature = SignaturePublisher(
            node,
            Entities(node),
            monitor.signature,
            tag,
            monitor.settings,
            None,
            self._causes.limits,
        )
        self._shown: tuple[tuple[bool, int, int], int] | None = None
        self._live = LiveJudgement(monitor.detector)
        self._judgement: Judgement | None = None
        if monitor.estimator.stride:
            self._isolation = node.create_publisher(Isolation, 'isolation', qos.FLAG)

    def take(self, sample: Sample) -> None:
        """
        Judge a sample.

        :param sample: of the recording.
        """
        estimate = self._monitor.estimator.update(*sample)
        if isinstance(estimate, Refused):
            return
        stamp, tag = sample.stamp, self._tag
        self._estimate.publish(self._estimates.encode(estimate, tag))
        decision = self._monitor.detector.update(estimate)
        self._residual.publish(self._numbers(stamp, tag, decision.residual))
        self._threshold.publish(self._numbers(stamp, tag, decision.threshold))
        shown = decision.shown, stamp // HEARTBEAT
        if shown != self._shown:
            self._shown = shown
            flag = FaultFlag(header=header_of(stamp, tag))
            write_flag(decision, flag)
            self._flag.publish(flag)
        judgement = self._monitor.estimator.judgement
        if judgement is self._judgement:
            judgement = None
        if judgement is not None:
            self._judgement = judgement
            self._isolation.publish(judgement_message(judgement, tag))
        for event in self._live.tell(decision.events, judgement):
            self._event.publish(event_message(explain(event, self._causes, tag), tag))
        self._signature.update(stamp, tag)


class Player(Node):
    """
    Publish the samples of a recording at the pace of their stamps.

    :param rate: speed in multiples of real time.
    :param monitor: what judges the samples; None publishes the samples alone.
    :param tag: of the actuator.
    :param context: of ROS 2; the process's where it is None.
    """

    def __init__(
        self, rate: float, monitor: Chain | None, tag: str, context: Context | None = None
    ) -> None:
        super().__init__('replay', context=context)
        self._rate = rate
        self._time = self.create_publisher(Clock, '/clock', 10)
        self._measurement = self.create_publisher(Measurement, 'measurement', qos.SAMPLES)
        self._state = self.create_publisher(FaultState, 'fault_state', qos.SAMPLES)
        self._judgements = Judgements(self, monitor, tag) if monitor else None
        self._tag = tag
        self._begin: tuple[int, float] | None = None  # stamp [ns] and wall time [s] of the start
        self._last_clock = 0.0

    def wait_for_subscribers(self, needed: bool) -> None:
        """Wait until all subscribers are matched; where they are needed, until there is one."""
        quiet_since = time.monotonic()
        last_known = -1
        told = False
        while rclpy.ok():
            time.sleep(0.05)
            matched = self._measurement.get_subscription_count()
            known = self.count_subscribers(self._measurement.topic_name)
            now = time.monotonic()
            if known != last_known or matched < known:
                last_known, quiet_since = known, now
            if now - quiet_since >= DISCOVERY:
                if matched or not needed:
                    return
                if not told:
                    self.get_logger().info(
                        'waiting for a node that subscribes to measurement: ros2 run damadics_fd'
                        ' estimator'
                    )
                    told = True

    def play(self, columns: Columns) -> Iterator[int]:
        """
        Publish columns at the pace of their stamps.

        :param columns: as a recording yields them.
        :return: the row of each sample, once it is published.
        """
        rows = zip(
            columns['stamp'].tolist(),
            *(
                np.broadcast_to(columns.get(name, np.nan), columns['stamp'].shape).tolist()
                for name in SIGNALS
            ),
            strict=True,
        )
        for row, (stamp, *signals) in enumerate(rows):
            self._wait_for(stamp)
            message = Measurement(**dict(zip(SIGNALS, signals, strict=True)))
            set_stamp(message.header.stamp, stamp)
            message.header.frame_id = self._tag
            self._measurement.publish(message)
            if 'fault' in columns:
                state = FaultState(
                    fault=int(columns['fault'][row]), strength=float(columns['strength'][row])
                )
                state.header = message.header
                self._state.publish(state)
            if self._judgements:
                self._judgements.take(Sample(stamp, *signals))
            yield row

    def finish(self) -> bool:
        """Let subscribers take what was published, then go; tell whether they have all."""
        taken = let_subscribers_take([self], FINISHING)
        self.destroy_node()
        return taken

    def _wait_for(self, stamp: int) -> None:
        """Wait until a sample is due, showing the time on /clock."""
        now = time.perf_counter()
        if self._begin is None:
            self._begin = stamp, now
        due = self._begin[1] + (stamp - self._begin[0]) * 1e-9 / self._rate
        while now < due:
            time.sleep(min(due - now, CLOCK_PERIOD))
            now = time.perf_counter()
            if due - now > CLOCK_PERIOD:
                self._tell(stamp - int((due - now) * self._rate * 1e9), now)
        if now - self._last_clock >= CLOCK_PERIOD:
            self._tell(stamp, now)

    def _tell(self, stamp: int, now: float) -> None:
        clock = Clock(clock=Time())
        set_stamp(clock.clock, stamp)
        self._time.publish(clock)
        self._last_clock = now


def publish(
    recordings: Sequence[Recording],
    plan: Plan,
    rate: float,
    inputs_only: bool = False,
    ros_args: Sequence[str] = (),
) -> int:
    """
    Publish recordings one after the other.

    :param recordings: what to publish.
    :param plan: mode and settings of estimator and detector.
    :param rate: speed in multiples of real time.
    :param inputs_only: publish the samples alone, for estimator and detector nodes that run.
    :param ros_args: arguments of ROS 2, from `--ros-args` on.
    :return: exit code, 0 also after SIGINT and SIGTERM, 3 where a subscriber did not take all.
    :raises BagError: where a recording cannot be read.
    """
    rclpy.init(args=list(ros_args))
    code = 0
    try:
        for recording in recordings:
            player = Player(rate, None if inputs_only else plan.monitor(), frame_id(recording))
            player.wait_for_subscribers(inputs_only)
            with tqdm(unit=' samples', unit_scale=True, desc=recording.name, disable=None) as bar:
                truth = recording.truth(lambda text: None)
                columns = None
                for columns in joined(recording.chunks(_warn)):
                    for _ in player.play(_with_truth(columns, truth)):
                        bar.update()
                        if not rclpy.ok():
                            return 0
            if not player.finish():
                code = LOSSY
            if columns is None:
                _warn(f'{recording.name}: has no measurement: the topic is empty')
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return code


def _warn(text: str) -> None:
    print(f'replay: warning: {text}', file=sys.stderr)


def _with_truth(columns: Columns, truth: Columns | None) -> Columns:
    """Add the fault of a simulated recording, where it is known for each sample."""
    if 'fault' in columns or truth is None or not len(truth['stamp']):
        return columns
    rows = np.searchsorted(truth['stamp'], columns['stamp'])
    rows = np.clip(rows, 0, len(truth['stamp']) - 1)
    if not np.array_equal(truth['stamp'][rows], columns['stamp']):
        return columns
    return columns | {name: truth[name][rows] for name in ('fault', 'strength')}
