# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Node `fleet`: the monitors of all valves of a list in one process."""

import sys
import time
from pathlib import Path

import numpy as np
from damadics_msgs.msg import (
    FleetLayout,
    FleetStatus,
    MeasurementBlock,
)

from damadics_fd.core.decision.events import Event
from damadics_fd.core.sample import SIGNALS, Sample
from damadics_fd.nodes.fleet import blocks, status
from damadics_fd.nodes.fleet.ages import Ages
from damadics_fd.nodes.fleet.handover import Handover
from damadics_fd.nodes.fleet.jumps import Jumps
from damadics_fd.nodes.fleet.keeping import Keeping, Operated
from damadics_fd.nodes.fleet.members import Happening, Members, members_of
from damadics_fd.nodes.fleet.raw_block import BlockReader
from damadics_fd.nodes.fleet.services import FleetServices
from damadics_fd.nodes.fleet.signatures import Signatures
from damadics_fd.nodes.fleet.strokes import FleetStrokes
from damadics_fd.nodes.fleet.telling import Telling
from damadics_fd.nodes.operator import OperatorActions
from damadics_fd.nodes.signature_publisher import read_causes
from damadics_fd.ros import qos
from damadics_fd.ros.arguments import command_parser, split_ros_args
from damadics_fd.ros.diagnostics import Diagnostics, Level, Report
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.parameters import Parameters
from damadics_fd.ros.raw import sample_of
from damadics_fd.ros.spin import SpinnableNode, StartError, spin_all
from damadics_fd.store.alarms import default_folder
from damadics_fd.store.fleet_file import FleetError, Valve, read_fleet
from damadics_fd.store.slots import check_folder

EXAMPLES = """examples:
  ros2 run damadics_fd fleet my_fleet.yaml
  ros2 run damadics_fd fleet my_fleet.yaml --ros-args -p expose:=0"""
HEARTBEAT = 1.0  # s of wall time
GATHER = 0.02  # s in which measurements of single valves are gathered
LAST = 5.0  # s for references that are not saved yet when the node ends
BATCH = 64  # of them that do not wait any longer
MOST_EXPOSED = 50  # valves with topics of their own, unless the user says otherwise


class FleetNode(SpinnableNode):
    """
    Judge blocks of measurements of many valves; publish what changes, and once a second all.

    :param valves: the list.
    """

    def __init__(self, valves: list[Valve]) -> None:
        super().__init__('fleet')
        self.finished, self.exit_code = False, 0
        parameters = Parameters(self)
        exposed = parameters.declare(
            'expose', MOST_EXPOSED, 'number of valves, from the first, with topics of their own'
        )
        kept = parameters.declare(
            'alarm_folder',
            'auto',
            'folder that keeps the alarms over a restart; "auto": one of the user; "": none',
        )
        handed = parameters.declare(
            'state_folder',
            '',
            'folder that takes the whole state of each valve when the process ends, and gives it '
            'to the next process with that valve; "": none',
        )
        max_age = parameters.declare(
            'max_age',
            0.0,
            'age from which a judgement is not healthy any more [s]; 0: the larger of 2 s and '
            'three sample periods of the valve',
        )
        self._causes = read_causes(
            parameters.declare('causes_file', '', 'YAML file with texts and advice per cause')
        )
        parameters.check()
        try:
            self._members = Members(members_of(valves), self._causes.classes)
            self._members.warm_up()
        except FleetError as problem:
            raise StartError(f'{problem}') from problem
        folder = default_folder() if kept == 'auto' else Path(kept).expanduser() if kept else None
        state = Path(handed).expanduser() if handed else None
        for name, one in (('alarm_folder', folder), ('state_folder', state)):
            if one and (cause := check_folder(one)):
                raise StartError(f'fleet cannot keep what it knows: {name}: {cause}')
        self._acts = folder / 'fleet.actions' if folder else None
        self._keeping = Keeping(self, self._members, folder)
        self._handover = Handover(self, self._members, state, folder)
        self._keeping.restore(self._handover.take())
        self._refused = blocks.Refused(len(self._members))
        self._judged = self._rejected = 0
        self._ages = Ages(
            np.array([1.0 / one.settings.sample_rate for one in self._members.all]),
            bool(self.get_parameter('use_sim_time').value),
            max_age,
        )
        self._version = blocks.layout_version(
            [one.namespace for one in self._members.all],
            [one.actuator for one in self._members.all],
        )
        self._read = BlockReader()
        self._others = blocks.OtherLayouts([one.namespace for one in self._members.all])
        self._gathered: list[tuple[int, Sample]] = []
        self._jumps = Jumps(len(self._members))
        self._entities = Entities(self)
        actions = OperatorActions(self, self._entities, 'fleet', self._acts)
        self._operated = Operated(self._entities, actions, self._members, self._keeping)
        self._strokes = FleetStrokes(self._operated, self._blind)
        self._telling = Telling(
            self,
            self._entities,
            self._members,
            self._keeping,
            self._ages,
            self._causes,
            self._strokes,
        )
        self._signatures = Signatures(
            self, self._entities, self._members, folder, self._causes.limits
        )
        self._make(min(max(exposed, 0), len(self._members)))

    def _make(self, exposed: int) -> None:
        made = self._entities
        self._layout = made.publisher(FleetLayout, 'fleet/layout', qos.FLAG)
        self._status = made.publisher(FleetStatus, 'fleet/status', qos.FLAG)
        FleetServices(self._operated, self._tell_all)
        self._diagnostics = Diagnostics(self, made, 'fleet', self._report)
        self._telling.expose(exposed, self._gather)
        self._signatures.restore(range(exposed))
        made.subscription(
            MeasurementBlock, 'measurement_block', self._take_block, qos.BLOCKS, raw=True
        )
        made.subscription(FleetLayout, 'fleet/layout', self._others.learn, qos.EVENTS)
        made.timer(HEARTBEAT, self._beat)
        if exposed:
            made.timer(GATHER, self._judge_gathered)
        layout = status.layout_message(self._members, self._version)
        layout.header.stamp = self.get_clock().now().to_msg()
        self._layout.publish(layout)
        self._beat()
        self.get_logger().info(
            f'{len(self._members)} valves, {exposed} with topics of their own, '
            f'layout {self._version}'
        )

    def _take_block(self, data: bytes) -> None:
        try:
            block = self._read(data)
        except ValueError as problem:
            self.get_logger().error(f'no block: {problem}', throttle_duration_sec=10.0)
            self._refuse([blocks.Refusal(blocks.UNREADABLE, np.empty(0, np.int64))], '')
            return
        rows, refusals = blocks.check(block, self._version, len(self._members), self._others)
        if refusals:
            self._refuse(refusals, block.sender)
        self._judge(rows)

    def _refuse(self, refusals: list[blocks.Refusal], sender: str) -> None:
        self._refused.note(refusals, sender)
        self.get_logger().warning(
            f'block of {sender or "an unnamed sender"} refused in part or whole: '
            f'{", ".join(one.reason for one in refusals)}',
            throttle_duration_sec=10.0,
        )

    def _judge(self, rows: blocks.Rows) -> None:
        if not len(rows.valve):
            return
        now = time.monotonic()
        rows = self._jumps.admit(rows, now)
        if not len(rows.valve):
            return
        self._keeping.begin(rows.valve, rows.stamp)
        self._signatures.begin(rows.valve, rows.stamp)
        self._ages.heard(rows.valve, rows.stamp, now)
        taken = self._telling.judge(rows)
        self._judged += len(rows.valve)
        self._rejected += taken.refused
        self._telling.tell(taken.happened)
        told = {number for number, _ in taken.happened}
        for number in taken.changed - told if told else taken.changed:
            self._telling.flag(number)

    def _gather(self, number: int, data: bytes) -> None:
        self._gathered.append((number, sample_of(data)))
        if len(self._gathered) >= BATCH:
            self._judge_gathered()

    def _judge_gathered(self) -> None:
        """Judge what single valves have sent since."""
        if not self._gathered:
            return
        gathered, self._gathered = self._gathered, []
        table = np.array([sample[1:] for _, sample in gathered], np.float64)
        self._judge(
            blocks.Rows(
                np.array([number for number, _ in gathered], np.int64),
                np.array([sample.stamp for _, sample in gathered], np.int64),
                {name: table[:, n].copy() for n, name in enumerate(SIGNALS)},
            )
        )

    def _tell_all(self, number: int, events: tuple[Event, ...], remark: str) -> None:
        self._telling.tell([Happening(number, event) for event in events], remark)

    def _beat(self) -> None:
        self._keeping.again()
        self._signatures.update()
        ages = self._telling.ages()
        message = status.status_message(self._members, self._version, ages, self._ages.limits)
        message.header.stamp = self.get_clock().now().to_msg()
        self._status.publish(message)
        self._telling.beat(ages)
        self._strokes.look()

    def _blind(self, number: int) -> bool:
        """Tell whether the newest sample of a valve is too old, or there is none."""
        return not self._telling.ages()[number] <= self._ages.limits[number]

    def _report(self) -> Report:
        blind = int(np.count_nonzero(~(self._telling.ages() <= self._ages.limits)))
        faults = int(np.count_nonzero(self._members.column('fault', np.bool_)))
        refused = sum(self._refused.by_reason.values())
        values = {
            'Valves': len(self._members),
            'Valves with a fault': faults,
            'Valves without fresh samples': blind,
            'Samples judged': self._judged - self._rejected,
            'Samples refused by their monitors': self._rejected,
            'Samples stamped far ahead': self._jumps.refused,
            **{f'Blocks refused: {why}': n for why, n in self._refused.by_reason.items()},
            **{f'Refused of {who}': n for who, n in self._refused.by_sender.items()},
            **self._strokes.values,
        }
        if self._entities.problem:
            return Level.ERROR, self._entities.problem, values
        if problems := self._keeping.problems + self._signatures.problems:
            return Level.ERROR, problems[0], values
        if faults:
            return Level.ERROR, f'{faults} valves with a fault', values
        if blind:
            return Level.WARN, f'{blind} of {len(self._members)} valves not monitored', values
        if refused:
            return Level.WARN, f'{refused} blocks were refused in part or whole', values
        return Level.OK, 'all valves monitored', values

    def destroy_node(self) -> None:
        """Judge what was gathered, save and hand over the valves, and release the node."""
        self._judge_gathered()
        self._keeping.again(patience=LAST)
        self._handover.give()
        self._entities.release()
        super().destroy_node()


def main(args: list[str] | None = None) -> int:
    """
    Run the node.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    own, ros_args = split_ros_args(args)
    p = command_parser('fleet', 'Monitor all valves of a list in one process.', EXAMPLES)
    p.add_argument('fleet', type=Path, metavar='FLEET.yaml', help='the list of valves')
    options = p.parse_args(own)
    try:
        valves = read_fleet(options.fleet)
    except FleetError as problem:
        print(f'fleet: {problem}', file=sys.stderr)
        return 2
    return spin_all([lambda: FleetNode(valves)], [sys.argv[0], *ros_args])


if __name__ == '__main__':
    sys.exit(main())
