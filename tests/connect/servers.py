# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Servers of the tests: each in its own process, on a port of its own."""

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import PATIENCE, free_port

HERE = Path(__file__).parent


def wait_for(condition, patience: float = PATIENCE, pause: float = 0.05) -> bool:
    """Wait until something has come true."""
    end = time.monotonic() + patience
    while not condition() and time.monotonic() < end:
        time.sleep(pause)
    return bool(condition())


def listens(port: int) -> bool:
    """Tell whether somebody listens."""
    with socket.socket() as probe:
        probe.settimeout(1.0)
        return probe.connect_ex(('127.0.0.1', port)) == 0


def namespaces() -> bool:
    """Tell whether a network of one's own may be made."""
    if not (shutil.which('unshare') and shutil.which('ip')):
        return False
    return subprocess.run([*NAMESPACE, 'true'], capture_output=True).returncode == 0


# with a shared memory of its own: ports of the network are free there that others have in memory
NAMESPACE = ('unshare', '-rnm', 'bash', '-c', 'mount -t tmpfs none /dev/shm && eval "$0"')
needs_namespace = pytest.mark.skipif(
    not namespaces(), reason='network namespaces are not allowed here'
)


def in_namespace(script: str, folder: Path, patience: float = 240.0) -> None:
    """Run a script of bash in a network of its own; whatever it has started ends with it."""
    environment = {**os.environ, 'RCUTILS_LOGGING_BUFFERED_STREAM': '0'}
    process = subprocess.Popen(
        [*NAMESPACE, script], cwd=folder, env=environment, start_new_session=True
    )
    try:
        assert process.wait(patience) == 0
    except subprocess.TimeoutExpired:
        logs = {path.name: path.read_text()[-1000:] for path in folder.glob('*.log')}
        pytest.fail(f'it still waits: {logs}')
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


class Server:
    """A server as a process that can be killed, held and started again."""

    def __init__(self, folder: Path, script: str, *arguments: object) -> None:
        self.port = free_port()
        self._log = folder / f'{Path(script).stem}_{self.port}.log'
        words = [str(self.port), *map(str, arguments)]
        program = shutil.which(script)
        self._command = (
            [program, *words] if program else [sys.executable, str(HERE / script), *words]
        )
        self._process: subprocess.Popen | None = None
        self.start()

    def start(self) -> None:
        with self._log.open('ab') as log:
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT
            )
        ready = lambda: listens(self.port) or self._process.poll() is not None  # noqa: E731
        if not wait_for(ready):
            self.kill()
            pytest.fail(f'{self._command} does not listen')
        assert self._process.poll() is None, self._log.read_text(errors='replace')[-2000:]

    def tell(self, line: str) -> None:
        self._process.stdin.write(line.encode() + b'\n')
        self._process.stdin.flush()

    def signal(self, number: int) -> None:
        os.kill(self._process.pid, number)

    def kill(self) -> None:
        if self._process.poll() is None:
            self.signal(signal.SIGCONT)
            self._process.kill()
        self._process.wait()
