# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What stands in place of curves: loading, no data yet, not measured."""

import math

import page_site
import pytest
import website
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultFlag, Measurement

pytestmark = website.IN_A_BROWSER


@pytest.fixture(scope='module')
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp('notes')
    with pytest.MonkeyPatch.context() as patch:
        site = page_site.Site(folder, patch)
        yield site
        site.close()


@pytest.fixture(scope='module')
def browser(site):
    with website.browser() as chromium:
        yield chromium


def test_a_plot_tells_loading_from_no_data_and_from_not_measured(site, browser):
    site.voices.flag('late', FaultFlag.STATE_HEALTHY, 'LV-3')
    page = website.new_page(browser)
    page.goto(f'{site.address}/valve/late')
    page.wait_for_selector('.banner[data-kind=ok]')
    page.wait_for_selector('text=There is no trend yet')  # which the server told after the plots

    def note(title: str) -> str:
        place = page.locator(f'section[aria-label="{title}"] .plot-note')
        return place.inner_text() if place.is_visible() else ''

    titles = (
        'Control value and position',
        'Residual against its limit',
        'Valve signature',
        'Flow',
    )
    first = [note(title) for title in titles]
    assert set(first) <= {'Loading …', 'No data yet'}, 'the latter when some seconds have passed'
    empty = f'section[aria-label="{titles[2]}"] .plot-note:has-text("No data yet")'
    page.wait_for_selector(empty)
    assert 'Learned\n–' in page.locator('.banner').inner_text(), 'what is not known is not 0 %'

    def send() -> None:
        sample = Measurement(cv=0.5, x1=0.5, flow=math.nan)
        sample.header.stamp = site.voices.node.get_clock().now().to_msg()
        site.voices.say('/late/measurement', sample, qos.SAMPLES)

    timer = site.voices.node.create_timer(0.05, send)
    page.wait_for_selector('.plot-note:has-text("Not measured")')
    assert [note(title) for title in titles] == ['', 'No data yet', 'No data yet', 'Not measured']
    site.voices.node.destroy_timer(timer)
    site.voices.silent.add('late')
    page.wait_for_selector('.banner[data-kind=off]')
    page.wait_for_selector(empty)
    assert [note(title) for title in titles] == ['', 'No data yet', 'No data yet', 'Not measured']
    page.close()
