# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What people ask of the valves of a fleet: one service each for one, some or all."""

from collections.abc import Callable
from typing import NamedTuple

from damadics_msgs.msg import OperatorAction
from damadics_msgs.srv import (
    FleetAcknowledge,
    FleetReference,
    FleetRelearn,
    FleetReset,
    FleetShelve,
)

from damadics_fd.core.decision.events import Event
from damadics_fd.core.text import COMMENT, NAME, SENTENCE, plain
from damadics_fd.nodes.fleet.keeping import Operated
from damadics_fd.nodes.operator import Answered, Signed, signed

ALL = '*'
MOST_TOLD = 5  # valves that an answer names


class Act(NamedTuple):
    """Hold what became of a request at one valve."""

    done: bool
    text: str
    events: tuple[Event, ...] = ()


Told = Callable[[int, tuple[Event, ...], str], None]


class FleetServices:
    """
    Serve the requests of operators.

    :param operated: the valves, their alarms and references, and the record.
    :param told: called with the events of a valve, and who caused them and why.
    """

    def __init__(self, operated: Operated, told: Told) -> None:
        entities, self._actions, self._members, self._keeping = operated
        self._told = told
        self._numbers = {one.namespace: n for n, one in enumerate(self._members.all)}
        entities.service(FleetAcknowledge, 'fleet/acknowledge', self._acknowledge)
        entities.service(FleetReset, 'fleet/reset', self._reset)
        entities.service(FleetShelve, 'fleet/shelve', self._shelve)
        entities.service(FleetRelearn, 'fleet/relearn', self._relearn)
        entities.service(FleetReference, 'fleet/reference', self._reference)

    def _acknowledge(
        self, request: FleetAcknowledge.Request, response: FleetAcknowledge.Response
    ) -> FleetAcknowledge.Response:
        def act(number: int) -> Act:
            return Act(*self._keeping.detector(number).acknowledge(request.occurrence or None))

        self._serve(OperatorAction.ACKNOWLEDGE, request.valves, act, request, response)
        return response

    def _reset(
        self, request: FleetReset.Request, response: FleetReset.Response
    ) -> FleetReset.Response:
        def act(number: int) -> Act:
            return Act(*self._keeping.detector(number).reset_alarm())

        self._serve(OperatorAction.RESET, request.valves, act, request, response)
        return response

    def _shelve(
        self, request: FleetShelve.Request, response: FleetShelve.Response
    ) -> FleetShelve.Response:
        def act(number: int) -> Act:
            detector = self._keeping.detector(number)
            seconds = request.duration
            return Act(*(detector.shelve(seconds) if seconds else detector.unshelve()))

        self._serve(OperatorAction.SHELVE, request.valves, act, request, response)
        return response

    def _relearn(
        self, request: FleetRelearn.Request, response: FleetRelearn.Response
    ) -> FleetRelearn.Response:
        def act(number: int) -> Act:
            bank, place = self._members.at(number)
            if bank.mode == 'paper':
                return Act(False, 'mode paper learns all the time: there is nothing to learn anew')
            bank.relearn(place, after_repair=True)
            self._keeping.detector(number).signature.relearn()
            return Act(True, 'learning anew: faults are not reported')

        self._serve(OperatorAction.RELEARN, request.valves, act, request, response)
        return response

    def _reference(
        self, request: FleetReference.Request, response: FleetReference.Response
    ) -> FleetReference.Response:
        def act(number: int) -> Act:
            do = self._keeping.save if request.save else self._keeping.load
            return Act(*do(number))

        kind = OperatorAction.SAVE_REFERENCE if request.save else OperatorAction.LOAD_REFERENCE
        self._serve(kind, request.valves, act, request, response)
        return response

    def _serve(
        self,
        action: int,
        valves: list[str],
        act: Callable[[int], Act],
        request: Signed,
        response: Answered,
    ) -> None:
        """Do it at each valve; the answer counts, and names the first that refused and why."""
        names = list(self._numbers) if ALL in valves else valves
        unknown = [plain(name, SENTENCE) for name in names if name not in self._numbers]
        numbers = [self._numbers[name] for name in names if name in self._numbers]
        failed = [f'{name}: there is no such valve' for name in unknown]
        done = 0
        for number in numbers:
            outcome = act(number)
            done += outcome.done
            name = self._members.all[number].namespace
            if not outcome.done:
                failed.append(f'{name}: {outcome.text.removeprefix(f"{name}: ")}')
            if outcome.events:
                self._told(number, outcome.events, self._remark(request))
        response.success = bool(numbers) and not failed
        words = [f'done for {done} of {len(names)} valves', *failed[:MOST_TOLD]]
        if len(failed) > MOST_TOLD:
            words.append(f'and {len(failed) - MOST_TOLD} more')
        response.message = plain('; '.join(words), SENTENCE)
        self._actions.tell(
            action,
            response.success,
            response.message,
            user=request.user,
            comment=request.comment,
        )

    @staticmethod
    def _remark(request: Signed) -> str:
        return signed(plain(request.user, NAME), plain(request.comment, COMMENT))
