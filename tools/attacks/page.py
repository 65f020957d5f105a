# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Malformed HTTP and websocket requests against a running page, and damaged databases under it."""

import base64
import random
import socket
import sqlite3
import struct
import subprocess
import time
from collections import Counter
from pathlib import Path

from ament_index_python.packages import get_package_prefix

PATIENCE = 10.0  # s that the page may take to answer a good request
START = 120.0  # s that it may take to start on a busy machine
LOOK = 10  # requests between two looks at whether it still answers
SOCKET_IO = '/_nicegui_ws/socket.io/?EIO=4&transport='
TARGETS = ('/', '/valve/PREY', '/history', '/assets/../../etc/passwd', '/%00', '/%zz', '*', '//x/')
VERSIONS = ('HTTP/1.1', 'HTTP/9', '')
TEXTS = ('cause', 'text', 'advice')  # columns of the history
WORDS = ('GET', 'POST', 'TRACE', 'PUT', 'CONNECT', 'get', 'G\0T', 'X' * 9000, '')


class Page:
    """
    A page of its own with a state folder.

    :param folder: for its state and its log.
    """

    def __init__(self, folder: Path) -> None:
        self.state = folder / 'page'
        self._log = folder / 'dashboard.log'
        self.process: subprocess.Popen[bytes] | None = None
        self.port = 0

    def start(self) -> bool:
        """
        Start it.

        :return: whether it answers.
        """
        with socket.create_server(('127.0.0.1', 0)) as free:
            self.port = free.getsockname()[1]
        program = Path(get_package_prefix('damadics_dashboard'), 'lib', 'damadics_dashboard')
        words = [str(program / 'dashboard'), '--port', str(self.port), '--state', str(self.state)]
        with self._log.open('ab') as log:
            self.process = subprocess.Popen(words, stdout=log, stderr=log)
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
        """Tell whether a good request is answered with the page."""
        request = f'GET / HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\nConnection: close\r\n\r\n'
        return self.send(request.encode(), patience=PATIENCE).startswith(b'HTTP/1.1 200')

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


def head(chance: random.Random, port: int) -> bytes:
    """
    Return the head of a request of which something is wrong.

    :param chance: source of what is wrong.
    :param port: of the page.
    :return: its bytes, with the empty line where that is not what is wrong.
    """
    host = chance.choice((f'127.0.0.1:{port}', '[::1', 'evil.example', '', '127.0.0.1:99999999'))
    lines = [
        f'{chance.choice(WORDS)} {chance.choice(TARGETS)} {chance.choice(VERSIONS)}',
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


def frames(chance: random.Random) -> bytes:
    """
    Return websocket frames of which something is wrong.

    :param chance: source of what is wrong.
    :return: their bytes.
    """
    text = chance.choice(
        (
            b'42["event",{"client_id":"x","id":1,"args":[1e999]}]',
            b'42["handshake",{}]',
            b'42[',
            b'451-["x",{"_placeholder":true,"num":9}]',
            b'40/other,',
            b'99999999999999999999',
            b'\xff\xfe',
            b'42["' + b'[' * 5000,
            b'42["javascript_response",{"request_id":"../","client_id":null}]',
        )
    )
    mask = chance.randbytes(4)
    masked = bytes(byte ^ mask[n % 4] for n, byte in enumerate(text))
    length = struct.pack('!BH', 0x80 | 126, len(masked))
    good = b'\x81' + length + mask + masked
    return chance.choice(
        (
            good,
            good * 50,
            b'\x81' + struct.pack('!B', len(text) % 126) + text,  # not masked
            b'\xf1' + length + mask + masked,  # reserved bits
            b'\x01' + length + mask + masked,  # begun and never ended
            b'\x88\x80' + mask,
            b'\x89\xfe\x01\x00' + mask + bytes(256),  # a ping that is too long
            b'\x82\xff' + struct.pack('!Q', 2**62) + mask,
            chance.randbytes(chance.randint(1, 300)),
        )
    )


def malformed(chance: random.Random, port: int) -> tuple[bytes, ...]:
    """
    Return a malformed request.

    :param chance: source of what is wrong.
    :param port: of the page.
    :return: its parts, each sent after the answer to the one before.
    """
    kind = chance.randrange(10)
    if kind < 4:
        return (head(chance, port),)
    if kind == 4:
        return (chance.randbytes(chance.randint(1, 3000)),)
    good = f'Host: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\n'
    if kind == 5:
        body = chance.choice(('40{"a":', '4' * 5000, '\x1e' * 100, 'b' + 'A' * 33, '2probe'))
        words = f'POST {SOCKET_IO}polling&sid={chance.choice(("", "x", "../"))} HTTP/1.1\r\n{good}'
        return (f'{words}Content-Length: {len(body)}\r\n\r\n{body}'.encode('latin-1'),)
    key = base64.b64encode(chance.randbytes(16)).decode()
    shake = (
        f'GET {SOCKET_IO}websocket&client_id={chance.choice(("", "x", "%00"))} HTTP/1.1\r\n{good}'
        f'Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n'
        f'Sec-WebSocket-Key: {key}\r\n\r\n'
    )
    return shake.encode(), *(frames(chance) for _ in range(chance.randint(1, 3)))


def attack_page(folder: Path, count: int, chance: random.Random, found: Counter[str]) -> None:
    """
    Send malformed requests to a page; it answers good ones all the time, and never fails.

    :param folder: for its state and its log.
    :param count: of requests.
    :param chance: source of what is wrong with them.
    :param found: counts what was found.
    """
    page = Page(folder)
    if not page.start():
        found['false start of the page'] += 1
        return
    for number in range(count):
        parts = malformed(chance, page.port)
        answer = page.send(*parts)
        status = answer.split(b' ', 2)[1:2]
        found['requests to the page'] += 1
        if status and status[0].startswith(b'5') and status[0] != b'501':
            found['failed: the page answers 5xx'] += 1
            print('5xx:', number, parts[0][:200], answer[:60], flush=True)
        if page.ended or (number % LOOK == LOOK - 1 and not page.answers()):
            found['no answer from the page'] += 1
            print('no answer:', number, parts[0][:200], flush=True)
            break
    if page.end() != 0:
        found['false end of the page'] += 1


def damaged(data: bytes, chance: random.Random) -> bytes:
    """
    Return a damaged database.

    :param data: of a whole one.
    :param chance: source of the damage.
    :return: its bytes.
    """
    kind = chance.randrange(6)
    if kind == 0:
        return data[: chance.randrange(len(data))]
    if kind == 1:
        return chance.randbytes(len(data))
    if kind == 2:
        return b'SQLite format 3\0' + bytes(len(data))
    spoilt = bytearray(data)
    for _ in range(chance.randint(1, 40)):
        spoilt[chance.randrange(100 if kind == 3 else len(spoilt))] = chance.randrange(256)
    return bytes(spoilt)


def attack_history(folder: Path, count: int, chance: random.Random, found: Counter[str]) -> None:
    """
    Damage the history; it opens all the same, and a damaged one is moved aside, not lost.

    :param folder: for the files.
    :param count: of damaged files.
    :param chance: source of the damage.
    :param found: counts what was found.
    """
    from damadics_dashboard.store.history import COLUMNS, History
    from damadics_dashboard.store.rows import EventRow

    file = folder / 'histories' / 'history.sqlite'
    file.parent.mkdir()

    def row(number: int) -> EventRow:
        values = {'valve': 'PREY', 'stamp': number, 'transition': 1, 'occurrence': number}
        given = {name: values.get(name, '' if name in TEXTS else 0) for name in COLUMNS}
        return EventRow(**given)

    history = History(file)
    for number in range(200):
        history.add(row(number))
    history.close()
    with sqlite3.connect(file) as connection:
        connection.execute('PRAGMA wal_checkpoint(TRUNCATE)')
    whole = file.read_bytes()
    for number in range(count):
        for old in file.parent.iterdir():
            old.unlink()
        file.write_bytes(damaged(whole, chance))
        try:
            history = History(file)
            history.latest()
            history.add(row(1000 + number))
            history.close()
        except Exception as problem:
            found['failed: the history'] += 1
            print('history:', number, type(problem).__name__, problem, flush=True)
        aside = [old for old in file.parent.iterdir() if '.bad-' in old.name]
        found['histories moved aside' if aside else 'histories read'] += 1
