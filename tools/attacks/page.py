# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Malformed HTTP and websocket requests against a running page, and damaged databases under it."""

import base64
import random
import sqlite3
import struct
from collections import Counter
from pathlib import Path

from attacks.server import Server, attack, head

SOCKET_IO = '/_nicegui_ws/socket.io/?EIO=4&transport='
TARGETS = ('/', '/valve/PREY', '/history', '/assets/../../etc/passwd', '/%00', '/%zz', '*', '//x/')
TEXTS = ('cause', 'text', 'advice')  # columns of the history


class Page(Server):
    """A page with a state folder of its own."""

    package, executable, good = 'damadics_dashboard', 'dashboard', '/'

    def arguments(self) -> list[str]:
        """Return its command line."""
        return ['--port', str(self.port), '--state', str(self.folder / 'page')]


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
        return (head(chance, port, TARGETS),)
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
    Send malformed requests to a page.

    :param folder: for its state and its log.
    :param count: of requests.
    :param chance: source of what is wrong with them.
    :param found: counts what was found.
    """
    page = Page(folder)
    attack(page, count, lambda: malformed(chance, page.port), found)


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
