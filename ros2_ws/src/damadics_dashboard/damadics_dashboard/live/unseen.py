# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How long of an alarm nobody could look: its driver was gone, or its input was refused."""

from collections import deque
from statistics import median

from damadics_fd.core.stamps import SECOND
from damadics_msgs.msg import FaultEvent

from damadics_dashboard.store.rows import EventRow

SHORTEST = 5 * SECOND  # ns; a shorter pause is none
USUAL = 20  # steps of which the middle one is the usual one


class Unseen:
    """Sum the pauses between judged samples, as long as a fault is present."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._occurrence = 0
        self._newest = 0
        self._present = False
        self._steps: deque[int] = deque(maxlen=USUAL)

    def judged(self, stamp: int, occurrence: int, *, present: bool) -> None:
        """
        Take the stamp of a judgement.

        :param stamp: [ns]; one that was there before does not matter.
        :param occurrence: number of the alarm.
        :param present: whether its fault is.
        """
        if occurrence != self._occurrence:
            self.seconds, self._occurrence = 0.0, occurrence
            self._present = False
        step = stamp - self._newest
        if self._newest and step > 0:
            if self._present and step > SHORTEST:
                usual = median(self._steps) if self._steps else step
                if step > 3 * usual:
                    self.seconds += step / SECOND
            self._steps.append(step)
        self._newest = max(stamp, self._newest) if step > -SHORTEST else stamp
        self._present = present

    def tell(self, event: EventRow) -> None:
        """
        Add to the end of an alarm how much of it nobody has seen.

        :param event: any transition, before it is kept.
        """
        if event['transition'] == FaultEvent.CLEARED:
            self.judged(event['stamp'], event['occurrence'], present=False)
            event['unseen'] = self.seconds
