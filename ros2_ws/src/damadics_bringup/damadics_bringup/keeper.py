# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Keep processes running: one that dies is started again, one that cannot run is told."""

import sys
import time
from typing import NamedTuple

from damadics_fd.core.text import SENTENCE, plain

from damadics_bringup.processes import Processes

FIRST_PAUSE, LONGEST_PAUSE = 1.0, 30.0  # s before a node that has died is started again
STABLE = 60.0  # s after which a node counts as running
USAGE = 2  # exit code of what was given wrong arguments


class Task(NamedTuple):
    """One process that is kept running."""

    label: str
    package: str
    executable: str
    arguments: list[str]


class Keeper:
    """
    Starts tasks and starts them again when they die, after a pause that doubles.

    One that ends with code 2 was given what it cannot use: it would end so again.

    :param processes: where they run.
    :param tasks: what is kept running.
    """

    def __init__(self, processes: Processes, tasks: list[Task]) -> None:
        self._processes = processes
        self._tasks = {task.label: task for task in tasks}
        self._started: dict[str, float] = {}
        self._due: dict[str, float] = {}
        self._pause = dict.fromkeys(self._tasks, FIRST_PAUSE)
        self.refused: set[str] = set()  # tasks that cannot run as they are
        for label in self._tasks:
            self._start(label)

    def look(self) -> None:
        """Start again what has died."""
        now = time.monotonic()
        for label in self._tasks:
            if label in self.refused:
                continue
            if label in self._due:
                if now >= self._due[label]:
                    del self._due[label]
                    self._start(label)
            elif (code := self._processes.exit_code(label)) is not None:
                if code == USAGE:
                    self.refused.add(label)
                    self._say(f'{label} cannot run as it is, and is not started again')
                    continue
                if now - self._started[label] > STABLE:
                    self._pause[label] = FIRST_PAUSE
                pause = self._pause[label]
                self._pause[label] = min(2.0 * pause, LONGEST_PAUSE)
                self._due[label] = now + pause
                self._say(f'{label} ended with exit code {code}, again in {pause:g} s')

    @property
    def hopeless(self) -> bool:
        """Whether nothing is left that can run."""
        return self.refused == set(self._tasks)

    def _say(self, text: str) -> None:
        log = self._processes.log(text.split(maxsplit=1)[0])
        words = log.read_text(errors='replace').strip().splitlines()[-1:]
        last = plain(words[0], SENTENCE) if words else 'no words'
        print(f'{text}: {last} ({log})', file=sys.stderr, flush=True)

    def _start(self, label: str) -> None:
        task = self._tasks[label]
        self._processes.start(task.package, task.executable, task.arguments, label)
        self._started[label] = time.monotonic()
