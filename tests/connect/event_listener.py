# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
A listener on the event stream, as a browser is one: `event_listener.py PORT`.

Prints a line for each state and transition, and one when two seconds have passed without a word;
it connects again, and says which message was its last.
"""

import sys
import time

import httpx
from event_stream import messages

SILENT = 2.0  # s: a valve is grey from then on


def main() -> None:
    url, number = f'http://127.0.0.1:{sys.argv[1]}/api/events', ''
    while True:
        headers = {'Last-Event-ID': number} if number else {}
        try:
            with httpx.stream('GET', url, headers=headers, timeout=SILENT) as stream:
                for number, name, told in messages(stream.iter_lines()):
                    what = told['state'] if name == 'valve' else told['transition']
                    say(name, told['valve'], what, number)
        except httpx.HTTPError:
            say('silence')
            time.sleep(0.2)


def say(*words: str) -> None:
    print(f'{time.time():.3f}', *words, flush=True)


main()
