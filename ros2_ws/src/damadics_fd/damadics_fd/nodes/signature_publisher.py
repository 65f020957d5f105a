# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Publish the valve signature and keep its trends."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from damadics_msgs.msg import Signature as SignatureMessage
from rclpy.node import Node
from std_msgs.msg import Header

from damadics_fd.causes import CauseTable, CauseTableError, load_causes
from damadics_fd.core.record import Array, Ints, Saved
from damadics_fd.core.settings import Settings
from damadics_fd.core.signature.own_alarm import own_alarm_ready
from damadics_fd.core.signature.signature import Signature
from damadics_fd.core.stamps import another_run
from damadics_fd.ros import qos
from damadics_fd.ros.conversions import header_of
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.spin import UsageError
from damadics_fd.store.file_names import file_name
from damadics_fd.store.references import (
    NoReferenceError,
    Reference,
    load_reference,
    save_reference,
)
from damadics_fd.store.trends import QUANTITIES, Outlook, TrendFile, series_name

PERIOD = 1_000_000_000  # ns of measurement time between two messages without news


def read_causes(path: str) -> CauseTable:
    """
    Read the table of causes that a node is given.

    :param path: file of the user; empty for the table of the package.
    :return: the table.
    :raises UsageError: naming everything that is wrong in it.
    """
    try:
        return load_causes(Path(path) if path else None)
    except (CauseTableError, OSError) as error:
        raise UsageError(f'causes_file: {error}') from error


class SignaturePublisher:
    """
    Publisher of `signature`, about once a second of measurement time and on every change.

    What it keeps in files is an auxiliary: where that fails, it is told and tried again, and the
    valve is monitored as before.

    :param node: the detector.
    :param entities: of the node.
    :param signature: of its core.
    :param actuator: tag; also names the files.
    :param settings: that the signature was learned with.
    :param folder: keeps the learned signature and its trends over a restart; None for none.
    :param limits: of the trends, per quantity.
    :param topic: to publish on; None where it is only kept.
    """

    def __init__(
        self,
        node: Node,
        entities: Entities,
        signature: Signature,
        actuator: str,
        settings: Settings,
        folder: Path | None,
        limits: Mapping[str, Sequence[float]],
        topic: str | None = 'signature',
    ) -> None:
        self._node = node
        self._signature = signature
        self._actuator = actuator
        self._settings = settings
        self._folder = folder
        self._limits = limits
        self._trend: TrendFile | None = None
        self._outlook: list[Outlook] = []
        self._restored: int | None = None  # stamp of the reference that was taken up
        self._saved: Saved = {}
        self.problem = ''  # why signature or trend are not kept
        self._state: Array | None = None
        self._news: list[Ints] = []
        self._last: list[int] = []
        self._next = 0
        self._publisher = (
            entities.publisher(SignatureMessage, topic, qos.FLAG) if topic is not None else None
        )

    def restore(self) -> None:
        """Take up the signature of before, where there is a good one."""
        if self._folder is None or self._settings.mode != 'monitor':
            return
        try:
            kept = load_reference(self._path(self._folder), self._actuator, self._settings)
            self._signature.load(kept.signature)
            self._saved = kept.signature
            self._restored = kept.last_stamp
            self._node.get_logger().info(f'signature of before taken up from {self._folder}')
        except NoReferenceError:
            self._node.get_logger().info(f'the signature is learned, and kept in {self._folder}')
        except ValueError as problem:
            self._node.get_logger().warning(f'the signature is learned anew: {problem}')

    def begin(self, stamp: int) -> None:
        """
        Learn anew where the signature of before belongs to another simulated run.

        :param stamp: of a measurement that is about to be judged [ns].
        """
        if self._restored is None:
            return
        if another_run(self._restored, stamp):
            self._node.get_logger().info('time begins anew: the signature is learned anew')
            self._signature.relearn()
            self._saved = {}
        self._restored = None

    @property
    def values(self) -> dict[str, str]:
        """Cause and outlook of each trend, for the diagnostics."""
        view = self._signature.view()
        unreadable = self._trend.unreadable if self._trend else 0
        return {
            'Cause': view.cause.replace('_', ' '),
            'Fault code': f'VALVE_{view.cause.upper()}',  # one fault per cause for fault managers
            **({'Lines of the trend unreadable': str(unreadable)} if unreadable else {}),
            **{f'Trend of {o.quantity}': o.sentence() for o in self._outlook},
        }

    def due(self, stamp: int) -> bool:
        """
        Tell whether a second is over since the last message.

        :param stamp: of the measurement [ns].
        :return: True where `update` would publish without news.
        """
        first, end = self.told
        return not first <= stamp < end

    @property
    def told(self) -> tuple[int, int]:
        """Stamps of the second that the last message stands for [ns]."""
        return self._next - PERIOD, self._next

    def update(self, stamp: int, tag: str) -> None:
        """
        Publish where there is news or a second is over.

        :param stamp: of the measurement [ns].
        :param tag: of the actuator, as the measurement says.
        """
        state = self._signature.state
        if state is not self._state:  # views of its fields: a record is slow to ask
            self._state, self._news = state, [state[name] for name in ('state', 'family', 'cause')]
        present = [int(field.item()) for field in self._news]
        if present == self._last and not self.due(stamp):
            return
        s = state[0]
        self._last, self._next = present, stamp + PERIOD
        if self._folder and s.verified:
            self._contained(self._folder, stamp)
        if self._publisher:
            message = signature_message(self._signature, header_of(stamp, tag))
            write_outlook(self._outlook, message)
            self._publisher.publish(message)

    def _contained(self, folder: Path, stamp: int) -> None:
        try:
            self._keep(folder, stamp)
            trend = self._trend
            self._outlook = trend.outlook(self._limits, stamp * 1e-9) if trend else []
        except Exception as problem:
            self._trend, self._outlook = None, []  # opened anew next time
            self.problem = f'signature and trend are not kept: {problem}'
            self._node.get_logger().error(
                f'{self.problem}; check folder and free space', throttle_duration_sec=60.0
            )
        else:
            self.problem = ''

    def _keep(self, folder: Path, stamp: int) -> None:
        s = self._signature.state[0]
        known = self._saved.get('theta'), self._saved.get('unit_weight')
        if self._trend is None or (s.theta.tolist(), float(s.unit_weight)) != known:
            saved = self._signature.save()
            if saved != self._saved:
                save_reference(
                    self._path(folder),
                    Reference(
                        self._actuator,
                        {},
                        self._settings.to_dict(),
                        saved,
                        source='live',
                        last_stamp=stamp,
                    ),
                )
                self._saved = saved
            self._trend = TrendFile(folder, self._actuator, series_name(saved))
        if s.now_t:
            self._trend.add(stamp, s.now.tolist(), s.now_std.tolist())

    def _path(self, folder: Path) -> Path:
        return folder / f'{file_name(self._actuator)}.signature'


def signature_message(signature: Signature, header: Header) -> SignatureMessage:
    """
    Return the state of the signature as a message.

    :param signature: of the core.
    :param header: of the measurement.
    :return: the message.
    """
    s, view = signature.state[0], signature.view()
    message = SignatureMessage(
        header=header,
        state=view.state,
        family=view.family,
        cause=int(s.cause),
        second=int(s.second) if s.cause == SignatureMessage.CAUSE_ELASTIC else 0,
        own_alarm_ready=bool(own_alarm_ready(s, signature.record[0])),
        progress=signature.progress,
        value=view.value,
        std=view.std,
        confidence=view.confidence,
        d=float(s.D.max()),
        kappa=float(s.kappa),
        sigma=float(s.sigma),
        stick_ratio=float(s.r_max / s.r_ref) if s.r_ref > 0.0 else 0.0,
        theta=s.theta[:4].tolist(),
        change=s.now.tolist(),
        change_std=s.now_std.tolist(),
        fill=float(s.air_rate[0]),
        vent=float(s.air_rate[1]),
    )
    if s.own:
        message.source = SignatureMessage.SOURCE_OWN
    elif s.state == SignatureMessage.STATE_ALARM:
        message.source = SignatureMessage.SOURCE_APPROXIMATOR
    return message


def write_outlook(outlook: Sequence[Outlook], message: SignatureMessage) -> None:
    """
    Write the time that each trend takes to its limit.

    :param outlook: of the trends that have enough points.
    :param message: written.
    """
    names = ('trend', 'limit', 'time_to_limit', 'time_to_limit_earliest', 'time_to_limit_latest')
    columns = {name: [math.nan] * len(QUANTITIES) for name in names}
    for o in outlook:
        row = (o.trend.slope * 86400.0, o.limit, o.time.expected, o.time.earliest, o.time.latest)
        for name, value in zip(names, row, strict=True):
            columns[name][QUANTITIES.index(o.quantity)] = value
    for name, values in columns.items():
        setattr(message, name, values)
