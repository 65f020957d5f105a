# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Partial strokes: small moves that a person asks for and the driver of the valve makes.

The monitor commands nothing itself: it checks the request, passes it on as `stroke_request`, and
asks for the end as soon as it does not see the valve or an alarm stands.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from damadics_msgs.msg import OperatorAction, StrokeRequest
from damadics_msgs.srv import PartialStroke

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.detector import Detector
from damadics_fd.nodes.operator import OperatorActions
from damadics_fd.ros import qos
from damadics_fd.ros.conversions import set_stamp
from damadics_fd.ros.entities import Entities
from damadics_fd.ros.parameters import Parameters

MOST_STROKES = 20  # of one request
PATIENCE = 30.0  # s that a stroke may take
ALLOWED, NOT_ALLOWED, UNDER_WAY = 'allowed', 'not allowed', 'under way'  # in the diagnostics
SEEN = 0.5  # of the amplitude: a stem that goes so far to both sides has made a stroke


AMPLITUDES = (0.001, 0.5)  # that `partial_stroke_limit` may allow
USUAL = 0.1


@dataclass(frozen=True)
class StrokeLimits:
    """What a request may ask for."""

    allowed: bool = False
    amplitude: float = USUAL  # greatest, share of full travel


def declared_limits(parameters: Parameters) -> StrokeLimits:
    """
    Declare what a request may ask for.

    :param parameters: of the node.
    :return: the limits.
    """
    return StrokeLimits(
        parameters.declare(
            'allow_partial_stroke', False, 'pass requests for partial strokes on to the driver'
        ),
        parameters.declare(
            'partial_stroke_limit',
            USUAL,
            'greatest amplitude of a partial stroke, share of full travel',
            limits=AMPLITUDES,
        ),
    )


@dataclass
class Strokes:
    """Strokes that are being made."""

    count: int
    amplitude: float
    centre: float  # position when they were asked for
    began: int  # ns
    halves: int = 0
    side: int = 0  # 1 above the centre, -1 below


class PartialStrokes:
    """
    Serve `partial_stroke`, publish `stroke_request`.

    :param entities: of the node.
    :param actions: the record of what people do.
    :param core: the detector.
    :param limits: what may be asked for.
    :param blind: tells whether the latest judgement says nothing about now.
    :param judged: tells whether there is an estimate at all.
    :param place: namespace of the valve, where it is not that of the node.
    :param tag: of the actuator, until an estimate brings another.
    :param changed: called with True when strokes begin, with False when they end.
    """

    def __init__(
        self,
        entities: Entities,
        actions: OperatorActions,
        core: Detector,
        limits: StrokeLimits,
        blind: Callable[[], bool],
        judged: Callable[[], bool],
        *,
        place: str = '',
        tag: str = '',
        changed: Callable[[bool], None] = lambda going: None,
    ) -> None:
        self._actions = actions
        self._core = core
        self._limits = limits
        self._blind = blind
        self._judged = judged
        self._place, self._changed = place, changed
        self._strokes: Strokes | None = None
        self._message, self._tag = StrokeRequest(), tag
        under = f'{place}/' if place else ''
        self._publisher = entities.publisher(StrokeRequest, f'{under}stroke_request', qos.COMMANDS)
        entities.service(PartialStroke, f'{under}partial_stroke', self._serve)
        entities.on_release(lambda: self.end('the monitor was stopped'))

    def follow(self, estimate: Estimate, frame_id: str) -> None:
        """
        Watch the stem; end the strokes when they are made, late, or an alarm stands.

        :param estimate: the newest.
        :param frame_id: tag of the actuator.
        """
        self._tag = frame_id
        strokes = self._strokes
        if strokes is None:
            return
        moved = estimate.x1 - strokes.centre
        side = int(math.copysign(1, moved))
        if abs(moved) >= SEEN * strokes.amplitude and side != strokes.side:
            strokes.side = side
            strokes.halves += 1
        if self._standing:
            self.end('an alarm stands')
        elif strokes.halves >= 2 * strokes.count:
            self._finish(True, f'{strokes.count} partial strokes were made')
        elif (estimate.stamp - strokes.began) * 1e-9 > PATIENCE * strokes.count:
            made = strokes.halves // 2
            self.end(f'the driver made {made} of {strokes.count} in time')

    @property
    def under_way(self) -> bool:
        """Whether strokes are being made: each estimate is then to be followed."""
        return self._strokes is not None

    @property
    def _estimate(self) -> Estimate | None:
        """The estimate that was judged last."""
        return self._core.estimate if self._judged() else None

    def end(self, cause: str) -> None:
        """
        Ask the driver to end the strokes, where there are any.

        :param cause: why.
        """
        if self._strokes is not None:
            self._send(0.0, 0)
            self._finish(False, f'partial strokes ended: {cause}')

    @property
    def values(self) -> dict[str, str]:
        """Values for the diagnostics: whether people may ask for strokes, and how large ones."""
        if not self._limits.allowed:
            return {'Partial strokes': NOT_ALLOWED}
        return {
            'Partial strokes': UNDER_WAY if self._strokes else ALLOWED,
            'Partial stroke limit (%)': f'{100.0 * self._limits.amplitude:g}',
        }

    @property
    def _standing(self) -> bool:
        """Whether there is an alarm, a shelved or latched one too."""
        s = self._core.state[0]
        return bool(s.active or s.latched)

    def _set(self, strokes: Strokes | None) -> None:
        self._strokes = strokes
        self._changed(strokes is not None)

    def _finish(self, done: bool, text: str) -> None:
        self._set(None)
        self._tell(done, text)

    def _tell(self, done: bool, text: str, user: str = '', comment: str = '') -> None:
        self._actions.tell(
            OperatorAction.PARTIAL_STROKE,
            done,
            f'{self._place}: {text}' if self._place else text,
            stamp=self._estimate.stamp if self._estimate else 0,
            user=user,
            comment=comment,
        )

    def _serve(
        self, request: PartialStroke.Request, response: PartialStroke.Response
    ) -> PartialStroke.Response:
        estimate = self._estimate
        response.message = self._refusal(request)
        response.success = not response.message
        if response.success and request.count == 0:
            self._set(None)
            self._send(0.0, 0)
            response.message = 'the driver was asked to end the partial strokes'
        elif response.success and estimate:
            self._message.request += 1
            amplitude, began = request.amplitude, estimate.stamp
            self._set(Strokes(request.count, amplitude, estimate.x1, began))
            self._send(request.amplitude, request.count)
            response.message = (
                f'the driver was asked for {request.count} partial strokes of '
                f'+-{100.0 * request.amplitude:g} %'
            )
        self._tell(response.success, response.message, request.user, request.comment)
        return response

    def _refusal(self, request: PartialStroke.Request) -> str:
        """Say why a request is refused, '' where it is not."""
        limits, amplitude, estimate = self._limits, request.amplitude, self._estimate
        if not limits.allowed:
            return 'partial strokes are not allowed here: allow_partial_stroke is false'
        if request.count == 0:
            return '' if self._strokes else 'there are no partial strokes to end'
        if self._strokes:
            return 'partial strokes are going on: wait, or end them with count 0'
        if not 0.0 < amplitude <= limits.amplitude:
            return (
                f'amplitude = {amplitude:g} is not within 0..{limits.amplitude:g}: '
                'partial_stroke_limit is the greatest'
            )
        if request.count > MOST_STROKES:
            return f'count = {request.count} is more than {MOST_STROKES}'
        if estimate is None or self._blind():
            return 'the valve is not seen: no measurement is being judged'
        if self._standing:
            return 'an alarm stands: reset it first'
        if not amplitude <= estimate.x1 <= 1.0 - amplitude:
            return f'the stem is at {estimate.x1:.2f}: +-{amplitude:g} would leave 0..1'
        if not self._publisher.get_subscription_count():
            return 'no driver of this valve takes stroke_request'
        return ''

    def _send(self, amplitude: float, count: int) -> None:
        message = self._message
        message.header.frame_id = self._tag
        message.amplitude, message.count = amplitude, count
        set_stamp(message.header.stamp, self._estimate.stamp if self._estimate else 0)
        self._publisher.publish(message)
