# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the tests of the page share: its address, a browser, the state of a tile."""

import json
import os
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from conftest import PATIENCE

PICTURES = os.environ.get('DAMADICS_SCREENSHOTS')  # folder to write pictures of the page to
CHROMIUM = Path('/usr/bin/chromium')
IN_A_BROWSER = [
    pytest.mark.ros,
    pytest.mark.skipif(
        not CHROMIUM.is_file(),
        reason='no browser: apt-get install chromium for the tests of the page',
    ),
]
FLAGS = [
    '--no-sandbox',
    '--disable-gpu',
    '--disable-quic',
    '--no-first-run',
    '--disable-sync',
    '--disable-background-networking',
    '--disable-component-update',
]
ALARM = ('M', 'S', 'F')  # classes of NE 107 that a tile with an alarm shows
# learn in seconds what takes a minute in earnest
LEARN_QUICKLY = {'t_on': 1.0, 't_w': 3.0, 't_learn': 8.0, 'travel_min': 0.1}
PLANT = {'scenario': 'random_nominal', 'model': 'lugre', 'rate': 200.0, 'seed': 1}


def wait_until_served(address: str, patience: float = PATIENCE) -> None:
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline:
        try:
            urllib.request.urlopen(address, timeout=PATIENCE).close()
            return
        except (urllib.error.URLError, OSError):
            time.sleep(0.2)
    raise AssertionError('the page is not served')


def picture(page: Any, name: str) -> None:
    """Keep a picture of a page where pictures are asked for."""
    if PICTURES:
        Path(PICTURES).mkdir(parents=True, exist_ok=True)
        page.screenshot(path=Path(PICTURES, name))


@contextmanager
def browser() -> Iterator[Any]:
    """Start Chromium; None where there is none."""
    if not CHROMIUM.is_file():
        yield None
        return
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        chromium = play.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS)
        yield chromium
        chromium.close()


def new_page(browser: Any, **options: Any) -> Any:
    """Open a page of a browser, or of a context of it, that is as patient as the other tests."""
    page = browser.new_page(**options)
    page.set_default_timeout(1000.0 * PATIENCE)
    return page


class Tile:
    """
    The tile of one valve: on the page in a browser, or else as the page's server has it.

    :param address: of the fleet page.
    :param valve: name of the valve.
    :param page: of the browser, if there is one.
    """

    def __init__(self, address: str, valve: str, page: Any = None) -> None:
        self._address = address
        self._valve = valve
        self._page = page
        if page and page.url.rstrip('/') != address:
            page.goto(address)

    def kind(self) -> str:
        """Return ok, learn, off, M, S, C or F; nothing while there is no tile."""
        if self._page:
            return self._page.evaluate(
                f"document.querySelector('[data-valve={self._valve}]')?.dataset.kind || ''"
            )
        with urllib.request.urlopen(f'{self._address}/state', timeout=PATIENCE) as answer:
            return json.load(answer).get(self._valve, '')

    def wait(self, kinds: tuple[str, ...], patience: float = PATIENCE) -> float:
        """Wait until the tile is of one of the kinds and return how long that took."""
        began = time.monotonic()
        while (kind := self.kind()) not in kinds:
            assert time.monotonic() - began < patience, (
                f'the tile is {kind}, not {kinds}: {self.account()}'
            )
            time.sleep(0.02)
        return time.monotonic() - began

    def account(self) -> str:
        """Tell what the page shows of the valve, and what its server would show."""
        words = ''
        if self._page:
            words = self._page.evaluate(
                f"document.querySelector('[data-valve={self._valve}]')?.innerText"
                " + ' (link ' + document.body.dataset.link + ')'"
            )
        with urllib.request.urlopen(f'{self._address}/state', timeout=PATIENCE) as answer:
            return f'{words!r}; the server says {answer.read().decode()}'
