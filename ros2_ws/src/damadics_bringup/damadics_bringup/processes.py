# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start the project's nodes as processes and end them again."""

import ctypes
import json
import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType

import yaml
from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from damadics_fd.core.record import Plain

PR_SET_PDEATHSIG = 1  # prctl(2)
# of a domain: discovery of all, which nobody opens who stays on this machine, and of the first
# twenty processes their own (RTPS 2.5, 9.6.2.3)
PORTS = (0, *range(10, 50))
_LIBC = ctypes.CDLL(None) if sys.platform == 'linux' else None


class ProcessError(Exception):
    """A node could not be started or ended badly; the message says which and shows its output."""


def free_domain() -> int:
    """
    Find a ROS domain that nobody uses on this machine.

    :return: a number from 1 to 99.
    :raises ProcessError: where all are in use.
    """
    domains = list(range(1, 100))
    random.SystemRandom().shuffle(domains)
    for domain in domains:
        if all(_is_free(7400 + 250 * domain + port) for port in PORTS):
            return domain
    raise ProcessError('every ROS domain from 1 to 99 is in use on this machine: end some nodes')


def _is_free(port: int) -> bool:
    """Tell whether nobody has a port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', port))
        except OSError:
            return False
    return True


def surroundings(domain: int) -> dict[str, str]:
    """
    Return the environment that keeps a run to itself.

    :param domain: its ROS domain.
    :return: variables for every process of the run.
    """
    return {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def executable(package: str, name: str) -> str:
    """
    Find a node's executable as `ros2 run` does.

    :param package: name of the ROS package.
    :param name: name of the executable.
    :return: its path.
    :raises ProcessError: where it is not installed.
    """
    try:
        path = Path(get_package_prefix(package), 'lib', package, name)
    except PackageNotFoundError:
        path = None
    if path is None or not path.is_file():
        raise ProcessError(
            f'{package} {name} is not installed: run make build, then source env.sh'
        )
    return str(path)


def parameters(**values: Plain) -> list[str]:
    """
    Write parameters as a node's command line takes them.

    :param values: parameters by name.
    :return: the arguments.

    >>> parameters(rate=400.0, noise=False)
    ['--ros-args', '-p', 'rate:=400.0', '-p', 'noise:=false']
    """
    return ['--ros-args', *assignments(values)]


def assignments(values: Mapping[str, Plain]) -> list[str]:
    """
    Write parameters as YAML values, so that a text stays a text.

    :param values: parameters by name.
    :return: words of a command line.

    >>> assignments({'noise': True, 'alarm_folder': '', 'actuator': '101'})
    ['-p', 'noise:=true', '-p', 'alarm_folder:=""', '-p', 'actuator:="101"']
    """
    words = []
    for name, value in values.items():
        words += ['-p', f'{name}:={value if _is_plain(value) else json.dumps(value, default=str)}']
    return words


def _is_plain(value: Plain) -> bool:
    """Tell whether YAML reads a text as it is."""
    try:
        return isinstance(value, str) and yaml.safe_load(value) == value
    except yaml.YAMLError:
        return False


def end_with(parent: int) -> None:
    """
    Have the kernel end this process when the one that started it dies, killed or not.

    Called in a new process before it runs its program; nothing here may allocate much.

    :param parent: number of the process that starts it.
    """
    if _LIBC is not None:
        _LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
        if os.getppid() != parent:  # it has died in between
            os._exit(1)


class Processes:
    """
    The processes of one run; leaving the context ends what still runs.

    They also end when this process dies, whatever kills it; start them from its main thread, whose
    end the kernel takes for that of the process.

    :param logs: folder for the output of each process.
    :param environment: variables added to this process's own.
    """

    def __init__(self, logs: Path, environment: dict[str, str] | None = None) -> None:
        self._logs = logs
        self._environment = {**os.environ, **(environment or {})}
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> 'Processes':
        """Begin with none."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End what still runs."""
        self.end_all()

    def end_all(
        self,
        patience: float = 10.0,
        patient_with: Mapping[str, float] | None = None,
        hurry: Callable[[], bool] = lambda: False,
    ) -> list[str]:
        """
        End all processes at the same time: SIGINT, and SIGKILL for what then still runs.

        :param patience: time that they may take, from now on [s].
        :param patient_with: another time for some of them [s].
        :param hurry: asked meanwhile; True ends the patience with all.
        :return: names of those that had to be killed.
        """
        longer = patient_with or {}
        began = time.monotonic()
        for process in self._running.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        killed = []
        while alive := [name for name in self._running if not self.ended(name)]:
            waited = time.monotonic() - began
            for name in alive:
                if waited > longer.get(name, patience) or hurry():
                    self.kill(name)
                    killed.append(name)
            time.sleep(0.02)
        return killed

    def forget(self, variable: str) -> None:
        """Start further processes without a variable of the environment."""
        self._environment.pop(variable, None)

    def start(
        self,
        package: str,
        name: str,
        arguments: Sequence[str] = (),
        label: str = '',
        more: Mapping[str, str] | None = None,
    ) -> None:
        """
        Start an executable.

        :param package: name of its ROS package.
        :param name: its name.
        :param arguments: its command line.
        :param label: what it is known by here, where one executable runs more than once.
        :param more: variables added to its environment alone.
        """
        label = label or name
        self.log(label).parent.mkdir(parents=True, exist_ok=True)
        with self.log(label).open('ab') as log:
            self._running[label] = subprocess.Popen(
                [executable(package, name), *arguments],
                stdout=log,
                stderr=subprocess.STDOUT,
                env=self._environment | dict(more or {}),
                start_new_session=True,  # Ctrl-C reaches it through this process, and once only
                preexec_fn=partial(end_with, os.getpid()),
            )

    def log(self, name: str) -> Path:
        """Return the file with the output of a process."""
        return self._logs / f'{name}.log'

    def ended(self, name: str) -> bool:
        """Tell whether a process has ended."""
        return self._running[name].poll() is not None

    def exit_code(self, name: str) -> int | None:
        """Return the exit code of a process, None while it runs."""
        return self._running[name].poll()

    def pid(self, name: str) -> int:
        """Return the number of a process."""
        return self._running[name].pid

    def kill(self, name: str) -> None:
        """End a process at once, as a crash would."""
        self._running[name].kill()
        self._running[name].wait()

    def check(self) -> None:
        """
        Make sure that nothing has failed so far.

        :raises ProcessError: where a process has ended with an error.
        """
        for name, process in self._running.items():
            if process.poll():
                raise ProcessError(
                    f'{name} ended with exit code {process.returncode}:\n{self._tail(name)}'
                )

    def end(self, name: str, patience: float = 60.0) -> None:
        """
        End a process with SIGINT and wait for it.

        :param name: name of the process.
        :param patience: time it may take [s].
        :raises ProcessError: where it does not end, or not with exit code 0.
        """
        process = self._running[name]
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + patience
        while process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        if process.poll() is None:
            process.kill()
            process.wait()
            raise ProcessError(f'{name} did not end within {patience:g} s:\n{self._tail(name)}')
        self.check()

    def _tail(self, name: str, lines: int = 15) -> str:
        text = self.log(name).read_text(errors='replace').splitlines()
        return '\n'.join(f'  {line}' for line in text[-lines:])
