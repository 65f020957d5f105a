# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Malformed requests against the HTTP connector, with a token of an operator and without."""

import json
import random
from collections import Counter
from pathlib import Path

from attacks.server import Server, attack, head

TOKEN = 'operator-0123456789abcdef0123456789'
VALVES = ('PREY', 'root', '', '../..', '%00', 'x' * 5000, '%zz', 'a/b?c#d', '\x1b[31m')
ACTIONS = ('acknowledge', 'reset', 'shelve', 'partial_stroke', 'relearn')
QUERIES = (
    '',
    '?since=-1',
    '?since=1e999',
    '?limit=0',
    '?limit=99999999999',
    '?valve=' + 'x' * 999,
)
TARGETS = (
    *(f'/api/{name}' for name in ('fleet', 'alarms', 'events', 'history', 'valves/%00', '../x')),
    *(f'/api/history{query}' for query in QUERIES),
    '/metrics',
    '/docs',
    '/openapi.json',
    '*',
    '//x/',
)
BODIES = (
    '{}',
    '{',
    '[]',
    'null',
    '{"occurrence": -1}',
    '{"occurrence": 1e999}',
    '{"occurrence": "1"}',
    '{"duration": NaN}',
    '{"duration": -Infinity}',
    '{"duration": 1e300}',
    '{"amplitude": 2.0, "count": 1}',
    '{"amplitude": 0.01, "count": 4294967296}',
    '{"user": "\\ud800"}',
    '{"user": "\\u0000\\u202e", "comment": "<script>"}',
    '{"comment": ' + '[' * 4000 + ']' * 4000 + '}',
    '{"user": {"user": {}}}',
    '{"user": "a", "user": "b", "what": 1}',
    '\xff\xfe',
    'x' * 20_000,
)


class Connector(Server):
    """An HTTP connector with one token."""

    package, executable, good = 'damadics_connect', 'http', '/api/fleet'
    words = (f'Authorization: Bearer {TOKEN}',)

    def arguments(self) -> list[str]:
        """Write its configuration; return its command line."""
        (self.folder / 'tokens').write_text(f'operator {TOKEN} Ann\n')
        config = self.folder / 'http.yaml'
        config.write_text(json.dumps({'port': self.port, 'token_file': 'tokens'}))
        return [str(config)]


def malformed(chance: random.Random, port: int) -> tuple[bytes, ...]:
    """
    Return a malformed request.

    :param chance: source of what is wrong.
    :param port: of the connector.
    :return: its parts, each sent after the answer to the one before.
    """
    kind = chance.randrange(10)
    if kind < 3:
        return (head(chance, port, TARGETS),)
    if kind == 3:
        return (chance.randbytes(chance.randint(1, 3000)),)
    token = chance.choice((TOKEN, TOKEN, TOKEN, TOKEN[:-1], '\x7f', 'x' * 9000, ''))
    lines = [f'Host: 127.0.0.1:{port}', f'Authorization: Bearer {token}']
    if kind == 4:
        lines.append(f'Last-Event-ID: {chance.choice(("-1", "9" * 30, "x", ""))}')
        words = [f'GET {chance.choice(TARGETS)} HTTP/1.1', *lines, '\r\n']
        return ('\r\n'.join(words).encode('latin-1'),)
    action, valve = chance.choice(ACTIONS), chance.choice(VALVES)
    body = chance.choice(BODIES).encode('latin-1')
    lines += [f'Content-Type: {chance.choice(("application/json", "text/plain", "x"))}']
    words = [f'POST /api/{action}/{valve} HTTP/1.1', *lines]
    if kind == 5:  # in pieces, of a size that nobody has stated
        words += ['Transfer-Encoding: chunked', '\r\n']
        piece = f'{len(body):x}\r\n'.encode() + body + b'\r\n'
        ends = chance.choice((b'0\r\n\r\n', b'', b'zz\r\n'))
        return ('\r\n'.join(words).encode('latin-1') + piece * chance.choice((1, 50)) + ends,)
    stated = chance.choice((len(body), len(body), len(body) + 5, max(len(body) - 5, 0)))
    words += [f'Content-Length: {stated}', '\r\n']
    return ('\r\n'.join(words).encode('latin-1') + body,)


def attack_connector(folder: Path, count: int, chance: random.Random, found: Counter[str]) -> None:
    """
    Send malformed requests to the HTTP connector.

    :param folder: for its configuration and its log.
    :param count: of requests.
    :param chance: source of what is wrong with them.
    :param found: counts what was found.
    """
    connector = Connector(folder)
    attack(connector, count, lambda: malformed(chance, connector.port), found)
