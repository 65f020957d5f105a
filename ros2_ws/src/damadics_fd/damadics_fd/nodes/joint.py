# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Estimator and detector of one valve in one process: estimates go from one to the other directly.

Over DDS this hop costs more than everything else that a sample needs.
"""

import math
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Protocol

from damadics_fd.core.approximator.state import Estimate
from damadics_fd.core.decision.detector import Detector
from damadics_fd.core.judgement import Judgement
from damadics_fd.nodes.input_watch import InputWatch
from damadics_fd.ros.process.rounds import Rounds
from damadics_fd.ros.raw import any_estimate, stamp_of

MOST_ECHOES = 100_000  # as many as the queue of samples holds
LINGERING = 5.0  # s that a subscription is kept which is not needed any more


class News(NamedTuple):
    """Say what is new with a judged sample."""

    happened: bool  # a transition of the alarm
    shown: bool  # a flag shows something else
    signed: bool  # state, family or cause of the signature is another


class Beside(Protocol):
    """A detector of which an estimator beside it may judge the ordinary estimates."""

    active: bool
    last: int  # stamp of its latest decision [ns]; -1 where there is none
    phase: int  # of the latest estimate
    unread: bool  # its latest decision was made with the sample

    @property
    def core(self) -> Detector:
        """The detector itself."""


class Taker:
    """
    A detector that is handed estimates.

    :param take: called with each estimate and its tag.
    :param hear: called with each judgement, where the mode has any.
    :param beside: the detector, where its estimates may be judged with the samples.
    :param judged: called after that, with stamp, tag and news; not for each sample of which there
        is nothing to tell.
    :param say: called in its place, with the tag, where `speaks`.
    """

    watch: InputWatch  # of the estimator beside

    def __init__(
        self,
        take: Callable[[Estimate, str], None],
        hear: Callable[[Judgement], None] = lambda judgement: None,
        beside: Beside | None = None,
        judged: Callable[[int, str, News], None] = lambda stamp, tag, news: None,
        say: Callable[[str], None] = lambda tag: None,
    ) -> None:
        self.take, self.hear, self.beside, self.judged = take, hear, beside, judged
        self.say = say
        self.speaks = False  # somebody listens to what the detector publishes of each sample
        self.subscribed = False  # DDS brings it estimates too
        self._echoes: deque[int] = deque(maxlen=MOST_ECHOES)
        self.ordinary = 0  # samples that `judged` was not called for
        self.tag = ''  # that it was called with
        self.until = -math.inf  # monotonic time up to which it need not be called [s]
        self.first, self.end = 0, 0  # stamps for which it need not be called [ns]

    def tell_each(self) -> None:
        """Call `judged` for each sample from now on."""
        self.until = -math.inf

    def rest(self, until: float, tag: str, stamps: tuple[int, int]) -> None:
        """
        Call `judged` no more for a while, but for news.

        :param until: monotonic time of the end [s].
        :param tag: of the samples for which that holds.
        :param stamps: the first of them, and the one behind the last [ns].
        """
        self.until, self.tag = until, tag
        self.first, self.end = stamps

    def sent(self, stamp: int) -> None:
        """
        Note an estimate that was also published: DDS will bring it to who subscribes to it too.

        :param stamp: of the estimate [ns].
        """
        if self.subscribed:
            self._echoes.append(stamp)

    def listen(self, subscribed: bool) -> None:
        """
        Note whether DDS brings estimates from now on.

        :param subscribed: whether it does.
        """
        self.subscribed = subscribed
        self._echoes.clear()

    def read(self, data: bytes) -> tuple[Estimate, str] | None:
        """
        Read what DDS brings.

        :param data: a serialised Estimate.
        :return: the estimate and its tag; None where it was handed over already.
        :raises ValueError: where it is no Estimate.
        """
        return None if self.is_echo(stamp_of(data)) else any_estimate(data)

    def is_echo(self, stamp: int | None) -> bool:
        """
        Tell whether DDS brings what was handed over already, once for each.

        :param stamp: of a message that has arrived [ns].
        :return: True if so; those that were lost before it are forgotten.
        """
        if stamp not in self._echoes:
            return False
        while self._echoes.popleft() != stamp:
            pass
        return True


class Joint:
    """Hold what one process has of one topic: detectors that take the estimates, estimators."""

    def __init__(self) -> None:
        self.estimators = 0  # that publish on it
        self.takers: list[Taker] = []
        self.only: Taker | None = None  # where there is one

    def join(self, taker: Taker) -> Callable[[], None]:
        """
        Add a detector.

        :param taker: it.
        :return: takes it away again.
        """

        def leave() -> None:
            self.takers.remove(taker)
            self._count()

        self.takers.append(taker)
        self._count()
        return leave

    def enter(self) -> Callable[[], None]:
        """
        Add an estimator.

        :return: takes it away again.
        """

        def leave() -> None:
            self.estimators -= 1

        self.estimators += 1
        return leave

    def heard(self, subscriptions: int) -> bool:
        """
        Tell whether others than these detectors subscribe.

        :param subscriptions: to the topic.
        :return: True if so.
        """
        return subscriptions > sum(taker.subscribed for taker in self.takers)

    def _count(self) -> None:
        self.only = self.takers[0] if len(self.takers) == 1 else None

    def hand(self, estimate: Estimate, tag: str) -> None:
        """
        Give an estimate to the detectors.

        :param estimate: of a sample.
        :param tag: of the actuator.
        """
        for taker in self.takers:
            taker.take(estimate, tag)

    def tell(self, judgement: Judgement) -> None:
        """
        Give a judgement to the detectors.

        :param judgement: of the estimator; over DDS it comes to them once more.
        """
        for taker in self.takers:
            taker.hear(judgement)


class Outside:
    """
    The subscription of a detector to its estimates, only while it needs one.

    What an estimator beside it publishes for others would come back to it through DDS, and cost
    more than all that a sample needs else. So it subscribes while there is none beside it, or
    somebody outside this process publishes on the topic too.

    :param joint: of the topic.
    :param taker: of the detector.
    :param watch: of the topic.
    :param subscribe: takes what DDS brings; returns what ends that.
    """

    def __init__(
        self,
        joint: Joint,
        taker: Taker,
        watch: InputWatch,
        subscribe: Callable[[], Callable[[], None]],
    ) -> None:
        self._joint, self._taker = joint, taker
        self._watch, self._subscribe = watch, subscribe
        self._end: Callable[[], None] | None = None  # of the subscription, where there is one
        self._needed = -math.inf  # monotonic time when it was needed last [s]

    def look(self) -> None:
        """Subscribe where that is needed now; end it where it was not for a while."""
        now, beside = time.monotonic(), self._joint.estimators
        if beside == 0 or self._watch.publishers > beside:
            self._needed = now
        needed = now - self._needed < LINGERING
        if needed and self._end is None:
            self._end = self._subscribe()
            self._taker.listen(True)
        elif not needed and self._end is not None:
            self._end()
            self._end = None
            self._taker.listen(False)


class Joints:
    """The joints of a process, by topic, and the rounds of its nodes."""

    def __init__(self) -> None:
        self._joints: dict[str, Joint] = {}
        self.rounds = Rounds()

    def at(self, topic: str) -> Joint:
        """
        Return the joint of a topic.

        :param topic: resolved name.
        :return: one and the same for estimator and detector.
        """
        return self._joints.setdefault(topic, Joint())
