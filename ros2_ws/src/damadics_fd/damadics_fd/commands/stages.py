# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What a command is doing, shown on a terminal and nowhere else."""

import sys
import threading
import time
from types import TracebackType
from typing import Self, TextIO

PACE = 0.5  # s between two looks at the clock
CLEAR = '\r\x1b[K'


class Stages:
    """
    A line that names the present stage and counts its seconds, gone at the end.

    :param command: that works, first word of the line.
    :param stream: where it is shown, if that is a terminal; standard error by default.
    """

    def __init__(self, command: str, stream: TextIO | None = None) -> None:
        self._command = command
        self._stream = stream or sys.stderr
        self._shown = self._stream.isatty()
        self._stage = ''
        self._since = 0.0
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._count, daemon=True)

    def __enter__(self) -> Self:
        """Begin to show."""
        if self._shown:
            self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the line away."""
        self._ended.set()
        if self._shown:
            self._thread.join()
        self.hide()

    def tell(self, stage: str) -> None:
        """
        Name the present stage.

        :param stage: in a few words.
        """
        with self._lock:
            self._stage, self._since = stage, time.monotonic()
        self._draw()

    def hide(self) -> None:
        """End the stage and take its line away, so that another can be printed."""
        with self._lock:
            if self._shown and self._stage:
                self._stream.write(CLEAR)
                self._stream.flush()
            self._stage = ''

    def _draw(self) -> None:
        with self._lock:
            if self._shown and self._stage:
                seconds = time.monotonic() - self._since
                self._stream.write(f'{CLEAR}{self._command}: {self._stage} ... {seconds:.0f} s')
                self._stream.flush()

    def _count(self) -> None:
        while not self._ended.wait(PACE):
            self._draw()
