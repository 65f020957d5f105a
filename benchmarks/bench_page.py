# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
What the page costs in a real Chromium: first paint, CPU of server and renderer, frames, requests.

    python benchmarks/bench_page.py --seconds 20

The valve's samples come at 200 Hz from this program; CPU time is counted per redraw, so that a
machine that is busy with other work (and then redraws less often) does not flatter the page.
"""

import argparse
import json
import math
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest
from damadics_fd.ros import qos
from damadics_msgs.msg import Estimate, FaultFlag, Float64Stamped, Measurement

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))
import page_site
import website
from bench_fleet import cpu

RATE = 200.0
REDRAWS = 5.0  # a second
VALVE = 'lv101'
FRAMES = """new Promise(done => {
  let frames = 0, begun = performance.now();
  const step = () => { frames += 1; scrollBy(0, 60);
    if (performance.now() - begun < 4000) requestAnimationFrame(step);
    else done(1000 * frames / (performance.now() - begun)); };
  requestAnimationFrame(step); })"""


class Source:
    """Samples, estimates and thresholds of one valve, in a thread of its own."""

    def __init__(self, voices: page_site.Voices) -> None:
        self.voices = voices
        self.done = threading.Event()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self) -> None:
        began, k = time.time(), 0
        node = self.voices.node
        say = {
            name: node.create_publisher(kind, f'/{VALVE}/{name}', qos.SAMPLES).publish
            for name, kind in (
                ('measurement', Measurement),
                ('estimate', Estimate),
                ('threshold', Float64Stamped),
            )
        }
        while not self.done.wait(max(0.0, began + k / RATE - time.time())):
            t = k / RATE
            x = 0.5 + 0.3 * math.sin(t / 3.0) + 0.001 * math.sin(97.0 * t)
            sample = Measurement(cv=x, x1=x - 0.01, p1=3.5e6, p2=2.6e6, t1=20.0, flow=5.0, ps=1e5)
            sample.header.stamp.sec, sample.header.stamp.nanosec = divmod(
                int((began + t) * 1e9), 10**9
            )
            header = sample.header
            say['measurement'](sample)
            say['estimate'](
                Estimate(header=header, xi2=0.05, x2=0.1 * math.cos(t), x1=x, u=x, phase=3)
            )
            say['threshold'](Float64Stamped(header=header, data=0.5))
            k += 1

    def close(self) -> None:
        """End the thread."""
        self.done.set()
        self.thread.join(5.0)


def renderer_of(page) -> int:
    """Return the process that draws a page: the renderer that works while only this page does."""
    processes = page.context.browser.new_browser_cdp_session().send('SystemInfo.getProcessInfo')
    known = {p['id']: cpu(p['id']) for p in processes['processInfo'] if p['type'] == 'renderer'}
    page.evaluate(
        '(() => { const end = performance.now() + 600; while (performance.now() < end); })()'
    )
    return max(known, key=lambda pid: cpu(pid) - known[pid])


def paint(page, address: str) -> float:
    """Return the time of the first contentful paint of a page that is opened again, s."""
    times = []
    for _ in range(3):
        page.goto(address)
        page.wait_for_function('performance.getEntriesByName("first-contentful-paint").length')
        times.append(
            page.evaluate('performance.getEntriesByName("first-contentful-paint")[0].startTime')
        )
    return min(times) / 1e3


SEARCH = """new Promise(done => {
  const field = document.getElementById('search'), begun = performance.now();
  field.value = 'V-0123';
  field.dispatchEvent(new Event('input'));
  requestAnimationFrame(() => setTimeout(() => {
    const took = performance.now() - begun;
    field.value = '';
    field.dispatchEvent(new Event('input'));
    done(took); })); })"""


def resident(pid: int) -> float:
    """Return the memory of a process, MB."""
    pages = int(Path(f'/proc/{pid}/statm').read_text().split()[1])
    return pages * 4096 / 1e6


def measure_fleet(site: page_site.Site, page, count: int) -> dict[str, float | int]:
    """Show a fleet: frames while it is scrolled, time of a search, memory."""
    layout, status = page_site.fleet_messages(count)
    site.voices.say('/fleet/layout', layout)
    done = threading.Event()

    def report() -> None:
        while not done.wait(1.0):
            status.header.stamp = site.voices.node.get_clock().now().to_msg()
            site.voices.say('/fleet/status', status)

    reporter = threading.Thread(target=report, daemon=True)
    reporter.start()
    page.goto(site.address)
    page.wait_for_function(
        f"document.querySelectorAll('.tile').length >= {count}", timeout=120_000
    )
    found: dict[str, float | int] = {
        f'frames a second, {count} tiles scrolled': max(page.evaluate(FRAMES) for _ in range(3)),
        f'search among {count} tiles, ms': min(page.evaluate(SEARCH) for _ in range(3)),
        f'server with {count} valves, MB': resident(site.processes.pid('dashboard')),
        f'renderer with {count} tiles, MB': resident(renderer_of(page)),
    }
    done.set()
    reporter.join(5.0)
    return found


def measure(folder: Path, seconds: float, counts: list[int]) -> dict[str, float | int]:
    found: dict[str, float | int] = {}
    with pytest.MonkeyPatch.context() as patch:
        site = page_site.Site(folder, patch)
        site.voices.flag(VALVE, FaultFlag.STATE_HEALTHY, 'LV-101')
        source = Source(site.voices)
        with website.browser() as chromium:
            page = chromium.new_page(viewport={'width': 1440, 'height': 900})
            foreign: list[str] = []
            page.on(
                'request',
                lambda r: (
                    r.url.startswith((site.address, 'data:', 'blob:')) or foreign.append(r.url)
                ),
            )
            page.goto(site.address)
            page.wait_for_selector(f'[data-valve={VALVE}][data-kind=ok]')
            found['first paint of the fleet, s'] = paint(page, site.address)
            address = f'{site.address}/valve/{VALVE}'
            found['first paint of a valve, s'] = paint(page, address)
            page.wait_for_function('window.damadics && damadics.messages > 20')
            pids = {
                'server': site.processes.pid('dashboard'),
                'renderer': renderer_of(page),
            }
            before = {kind: cpu(pid) for kind, pid in pids.items()}
            drawn, began = page.evaluate('damadics.messages'), time.monotonic()
            page.wait_for_timeout(seconds * 1e3)
            drawn = page.evaluate('damadics.messages') - drawn
            found['redraws a second'] = drawn / (time.monotonic() - began)
            for kind, pid in pids.items():
                share = (cpu(pid) - before[kind]) / drawn * REDRAWS
                found[f'{kind} at {REDRAWS:g} redraws a second, % of a core'] = 100.0 * share
            source.close()
            for count in counts:
                found |= measure_fleet(site, page, count)
            for other in ('/history', '/replay'):
                page.goto(site.address + other)
                page.wait_for_timeout(500)
            found['requests to other machines'] = len(foreign)
        site.close()
    return found


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument('--seconds', type=float, default=20.0, help='of measurement (20)')
    parser.add_argument(
        '--valves', type=int, nargs='*', default=[1000, 10_000], help='of a fleet (1000 10000)'
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print(json.dumps(measure(Path(folder), options.seconds, options.valves), indent=2))
    return 0


if __name__ == '__main__':
    sys.exit(main())
