# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A server that is attacked, and the heads of requests of which something is wrong."""

import random
import socket
import subprocess
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from ament_index_python.packages import get_package_prefix

PATIENCE = 10.0  # s that a server may take to answer a good request
START = 120.0  # s that it may take to start on a busy machine
LOOK = 10  # requests between two looks at whether it still answers
VERSIONS = ('HTTP/1.1', 'HTTP/9', '')
WORDS = ('GET', 'POST', 'TRACE', 'PUT', 'CONNECT', 'get', 'G\0T', 'X' * 9000, '')


class Server(ABC):
    """
    A server of the project as a process of its own.

    :param folder: for its log.
    """

    package: str
    executable: str
    good: str  # what can be asked for
    words: tuple[str, ...] = ()  # more lines of the head of a good request

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.process: subprocess.Popen[bytes] | None = None
        self.port = 0

    @abstractmethod
    def arguments(self) -> list[str]:
        """Return its command line."""

    def start(self) -> bool:
        """
        Start it.

        :return: whether it answers.
        """
        with socket.create_server(('127.0.0.1', 0)) as free:
            self.port = free.getsockname()[1]
        program = Path(get_package_prefix(self.package), 'lib', self.package, self.executable)
        with (self.folder / f'{self.executable}.log').open('ab') as log:
            self.process = subprocess.Popen(
                [str(program), *self.arguments()], stdout=log, stderr=log
            )
        end = time.monotonic() + START
        while time.monotonic() < end and self.process.poll() is None:
            if self.answers():
                return True
            time.sleep(0.2)
        return False

    def end(self) -> int | None:
        """
        End it as Ctrl-C does.

        :return: its exit code; None where it had to be killed.
        """
        if self.process is None:
            return 0
        self.process.terminate()
        try:
            return self.process.wait(30.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return None

    @property
    def ended(self) -> bool:
        """Whether its process has ended."""
        return self.process is None or self.process.poll() is not None

    def answers(self) -> bool:
        """Tell whether a good request is answered with what was asked for."""
        lines = (
            f'GET {self.good} HTTP/1.1',
            f'Host: 127.0.0.1:{self.port}',
            *self.words,
            'Connection: close\r\n\r\n',
        )
        answer = self.send('\r\n'.join(lines).encode(), patience=PATIENCE)
        return answer.startswith(b'HTTP/1.1 200')

    def send(self, *parts: bytes, patience: float = 0.5) -> bytes:
        """
        Send bytes, one part after the other, and return what comes back first.

        :param parts: sent with a pause after the first.
        :param patience: time to wait for an answer [s].
        :return: the beginning of the answer, empty where there is none.
        """
        answer = b''
        try:
            with socket.create_connection(('127.0.0.1', self.port), PATIENCE) as connection:
                connection.settimeout(patience)
                for number, part in enumerate(parts):
                    connection.sendall(part)
                    if number == 0 and len(parts) > 1:
                        answer += connection.recv(4096)
                answer += connection.recv(4096)
        except OSError:
            pass
        return answer


def head(chance: random.Random, port: int, targets: Sequence[str]) -> bytes:
    """
    Return the head of a request of which something is wrong.

    :param chance: source of what is wrong.
    :param port: of the server.
    :param targets: what is asked for.
    :return: its bytes, with the empty line where that is not what is wrong.
    """
    host = chance.choice((f'127.0.0.1:{port}', '[::1', 'evil.example', '', '127.0.0.1:99999999'))
    lines = [
        f'{chance.choice(WORDS)} {chance.choice(targets)} {chance.choice(VERSIONS)}',
        f'Host: {host}',
        chance.choice(
            (
                'Origin: http://[x',
                'Origin: null',
                'Content-Length: -1',
                'Content-Length: 99999999999999999999',
                'Content-Length: 5\r\nContent-Length: 6',
                'Transfer-Encoding: chunked\r\nContent-Length: 3',
                'Cookie: damadics_token=' + '\x7f;"' * 50,
                'Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: !',
                'Expect: 100-continue',
                ': no name',
                'X-Long: ' + 'x' * 100_000,
            )
        ),
    ]
    end = chance.choice(('\r\n\r\n', '\n\n', '', '\r\n\r\nzz\r\n', '\r\n\r\n{"a":1}'))
    return ('\r\n'.join(lines) + end).encode('latin-1')


def attack(
    server: Server,
    count: int,
    malformed: Callable[[], tuple[bytes, ...]],
    found: Counter[str],
) -> None:
    """
    Send malformed requests to a server; it answers good ones all the time, and never fails.

    :param server: not started yet.
    :param count: of requests.
    :param malformed: returns the parts of a request.
    :param found: counts what was found.
    """
    name = server.executable
    if not server.start():
        found[f'false start of {name}'] += 1
        return
    for number in range(count):
        parts = malformed()
        answer = server.send(*parts)
        status = answer.split(b' ', 2)[1:2]
        found[f'requests to {name}'] += 1
        if status and status[0].startswith(b'5') and status[0] != b'501':
            found[f'failed: {name} answers 5xx'] += 1
            print('5xx:', number, parts[0][:200], answer[:60], flush=True)
        if server.ended or (number % LOOK == LOOK - 1 and not server.answers()):
            found[f'no answer from {name}'] += 1
            print('no answer:', number, parts[0][:200], flush=True)
            break
    if server.end() != 0:
        found[f'false end of {name}'] += 1
