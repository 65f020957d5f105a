# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The thread between the recorder's callbacks and the disk."""

import threading
import time
from collections import deque

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.rosbag2 import Topic
from damadics_fd.bag.writing.bag_writer import BagWriter
from damadics_fd.bag.writing.blackbox import BlackBox

Item = tuple[Topic, bytes, int, int]  # topic, serialised message, log and publish time [ns]

PERIOD = 0.05  # [s] between two looks at the queue
RETRY_PERIOD = 1.0  # [s] between two attempts while the disk refuses


class Spool:
    """
    Write queued messages to a bag from a thread of its own.

    A slow disk delays nobody: messages wait in the queue. A full one is tried again every second;
    with a quota, the oldest file of the bag makes room first. Beyond `most_waiting` messages the
    newest are dropped and counted.

    :param bag: bag to write; the thread owns it until `close` has returned.
    :param rotate: remove the oldest file of the bag when the disk is full.
    :param most_waiting: bound on the queue, in messages.
    """

    def __init__(
        self, bag: BagWriter | BlackBox, rotate: bool = False, most_waiting: int = 1_000_000
    ):
        self.bag = bag
        self.dropped = 0
        self.error = ''  # why nothing can be written at present
        self.taken = 0  # messages handed to the bag
        self.lost_of_taken = 0  # those that the disk refused when the bag was closed
        self._rotate = rotate
        self._most_waiting = most_waiting
        self._queue: deque[Item] = deque()
        self.put = self._queue.append  # the whole work of a callback
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='spool', daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """Messages in the queue."""
        return len(self._queue)

    @property
    def received(self) -> int:
        """Messages taken, waiting or dropped."""
        return self.taken + len(self._queue) + self.dropped

    def _run(self) -> None:
        retry_at = 0.0
        while not self._stop.wait(PERIOD):
            if time.monotonic() >= retry_at and not self._drain():
                retry_at = time.monotonic() + RETRY_PERIOD
            while len(self._queue) > self._most_waiting:
                self._queue.pop()
                self.dropped += 1

    def _drain(self) -> bool:
        """Write what is queued; tell whether the disk took it."""
        try:
            if self.error:
                self.bag.flush()
                self.error = ''
            for _ in range(len(self._queue)):
                message = self._queue.popleft()
                self.taken += 1
                self.bag.write(*message)
            self.bag.flush_if_due()
        except (OSError, BagError) as error:
            self._fail(error)
            return self._rotate and self.bag.drop_oldest()
        return True

    def _fail(self, error: OSError | BagError) -> None:
        reason = error.strerror if isinstance(error, OSError) else error.reason
        self.error = f'{reason} ({self.bag.path})'

    @property
    def written(self) -> int:
        """Messages in the files of the bag."""
        return sum(self.bag.counts.values()) - self.lost_of_taken

    def close(self) -> None:
        """
        Write everything that is queued and finish the bag.

        Where the disk refuses, `error` says why and `dropped` how many messages are lost;
        finished chunks stay readable.
        """
        self._stop.set()
        self._thread.join()
        while self._queue:
            if not self._drain():
                break
        try:
            self.bag.close()
            self.error = ''
        except (OSError, BagError) as error:
            self._fail(error)
            self.dropped += self.bag.unsaved
            self.lost_of_taken = self.bag.unsaved
            self.bag.abandon()
        self.dropped += len(self._queue)
        self._queue.clear()
