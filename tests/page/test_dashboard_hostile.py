# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The page against texts that are markup, a server that is gone, silence, and a large fleet."""

import io
import os
import signal
import time

import page_site
import pytest
import website
from conftest import promised
from damadics_dashboard.words.texts import texts
from damadics_fd.bag.mcap.writer import McapWriter
from damadics_fd.ros import qos
from damadics_msgs.msg import FaultEvent, FaultFlag, Isolation, OperatorAction
from damadics_msgs.srv import PartialStroke

sync_api = pytest.importorskip('playwright.sync_api')
pytestmark = website.IN_A_BROWSER
EVIL = (
    'T" innerHTML="<img src=x onerror=window.pwn=1>" onclick="window.pwn=2" x=\''
    '<img src=x onerror=window.pwn=3><script>window.pwn=4</script>`${window.pwn=5}`{{7*7}}'
    "');window.pwn=6;//\x1b[31m"
)
NO_ALARM = (
    FaultFlag.STATE_NOT_MONITORING,
    FaultFlag.STATE_LEARNING,
    FaultFlag.STATE_HEALTHY,
)
STATES = (
    *NO_ALARM,
    FaultFlag.STATE_ALARM,
    FaultFlag.STATE_LATCHED,
    FaultFlag.STATE_SHELVED,
    FaultFlag.STATE_UNKNOWN,
)
PAGES = ('/', '/valve/~root', '/valve/hostile/v1', '/history', '/replay', '/valve/none%22%3Ex')


@pytest.fixture(scope='module')
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp('hostile')
    with pytest.MonkeyPatch.context() as patch:
        site = page_site.Site(folder, patch)
        yield site
        site.close()


@pytest.fixture(scope='module')
def browser(site):
    with website.browser() as chromium:
        yield chromium


@pytest.fixture(scope='module')
def hostile(site):
    """Valves whose every text is an attack."""
    for valve in ('', 'hostile/v1'):
        site.voices.flag(
            valve, FaultFlag.STATE_ALARM, EVIL, occurrence=1, level=1, fault=True, residual=0.9
        )
        for transition in (FaultEvent.RAISED, FaultEvent.CHANGED):
            site.voices.event(
                valve, transition, EVIL, occurrence=1, level=1, ratio=1.8,
                cause=EVIL, text=f'{transition} {EVIL}', advice=EVIL,
            )  # fmt: skip
        action = OperatorAction(user=EVIL, role=EVIL, comment=EVIL, result=EVIL, success=True)
        prefix = f'/{valve}' if valve else ''
        site.voices.say(f'{prefix}/operator_action', action, qos.EVENTS)
        isolation = Isolation(test=EVIL, found_by=EVIL, candidate=[EVIL], text=EVIL)
        isolation.confidence = [0.9]
        site.voices.say(f'{prefix}/isolation', isolation)
    return site


def unharmed(page) -> None:
    """Assert that nothing from outside was run or parsed."""
    assert page.evaluate('window.pwn') is None
    assert page.locator('img[src=x]').count() == 0
    assert page.locator('main [onclick], main [onerror], main script').count() == 0


@pytest.mark.parametrize('address', PAGES)
def test_no_text_from_outside_is_run_or_parsed(hostile, browser, address):
    page = website.new_page(browser)
    foreign = []
    page.on('request', lambda r: foreign.append(r.url) if hostile.address not in r.url else None)
    page.goto(hostile.address + address)
    page.wait_for_timeout(2500)
    unharmed(page)
    if address == '/':
        shown = page.locator('[data-valve=""] .name').inner_text()
        assert '<img src=x' in shown and '\x1b' not in shown, 'it is shown as the text that it is'
    for button in page.get_by_role('button', name='Acknowledge').all()[:2]:
        button.dispatch_event('click')
        page.wait_for_timeout(300)
        page.keyboard.press('Escape')
    unharmed(page)
    outside = [u for u in foreign if not u.startswith(('data:', 'blob:', 'ws://127.0.0.1'))]
    assert outside == [], 'nothing is asked of another machine'
    page.close()


def test_a_name_and_a_comment_of_a_person_are_data_too(hostile, browser):
    page = website.new_page(browser)
    page.goto(f'{hostile.address}/history')
    page.get_by_label('Comment, on the valve').fill(EVIL)
    page.get_by_label('Your name').fill(EVIL)
    page.get_by_role('button', name='Add comment').click()
    page.wait_for_selector('table.list td >> text=Comment')
    unharmed(page)
    page.reload()
    page.wait_for_timeout(1500)
    unharmed(page)
    page.close()


def test_the_name_of_a_dropped_file_is_data(hostile, browser, tmp_path):
    page = website.new_page(browser)
    page.goto(f'{hostile.address}/replay')
    name = '..\\<img src=x onerror=window.pwn=1>".mcap'
    page.set_input_files(
        '.drop input[type=file]',
        files=[{'name': name, 'mimeType': 'x/y', 'buffer': b'\x89MCAP0\r\n' + bytes(99)}],
    )
    page.wait_for_selector('[role=alert] >> text=cannot be replayed')
    unharmed(page)
    assert page.locator('.drop input[type=file]').is_enabled()
    page.close()


def test_a_recording_that_cannot_be_replayed_leaves_the_page_as_it_was(site, browser):
    page = website.new_page(browser)
    page.goto(f'{site.address}/replay')
    for name in ('../../../etc/passwd', 'x', ''):
        content = io.BytesIO()
        writer = McapWriter(content)
        schema = writer.add_schema(name, 'ros2msg', b'float64 cv\nfloat64 x1')
        channel = writer.add_channel(schema, '/measurement', 'cdr', {})
        writer.add_message(channel, b'\0\1\0\0' + bytes(16), 1, 1)
        writer.finish()
        dropped = {'name': 'a.mcap', 'mimeType': 'x/y', 'buffer': content.getvalue()}
        page.set_input_files('.drop input[type=file]', files=[dropped])
        refused = '/cannot be replayed/.test(document.body.innerText)'
        done = f"document.querySelector('.banner') || {refused}"
        page.wait_for_function(done)
        page.wait_for_selector('.drop input[type=file]:enabled', state='attached')
        page.reload()
    page.close()


@pytest.mark.parametrize('kind', ['html', 'csv', 'pdf'])
def test_reports_show_texts_as_they_are(hostile, browser, kind):
    page = website.new_page(browser)
    answer = page.request.get(f'{hostile.address}/report?of=hostile%2Fv1&days=1&as={kind}')
    assert answer.status == 200
    if kind == 'html':
        page.goto(f'{hostile.address}/report?of=hostile%2Fv1&days=1&as=html')
        page.wait_for_timeout(500)
        unharmed(page)
        assert page_site.serious(page) == []
    page.close()


def kinds(page) -> list[str]:
    return page.evaluate(
        "[...document.querySelectorAll('.tile')].map(t => getComputedStyle(t)"
        ".getPropertyValue('--tone').trim())"
    )


def test_a_page_whose_server_is_gone_turns_grey_within_two_seconds(site, browser):
    site.voices.flag('watched', FaultFlag.STATE_HEALTHY, 'LV-1')
    page = website.new_page(browser)
    page.goto(site.address)
    page.wait_for_selector('[data-valve=watched][data-kind=ok]')
    page.wait_for_function("document.body.dataset.link === 'good'")
    assert page.title().startswith('Fleet')
    grey = page.evaluate("getComputedStyle(document.body).getPropertyValue('--off').trim()")
    os.kill(site.processes.pid('dashboard'), signal.SIGSTOP)
    try:
        stopped = time.monotonic()
        page.wait_for_function("document.body.dataset.link === 'lost'", polling=20)
        assert time.monotonic() - stopped < promised(2.0)
        assert set(kinds(page)) == {grey}
        assert page.title().startswith('(no connection)')
        line = "getComputedStyle(document.querySelector('[data-valve=watched] .state b'))"
        assert page.evaluate(f'{line}.textDecorationLine') == 'line-through', 'no word of health'
        assert 'No connection' in page.locator('#link').inner_text()
        age = page.locator('[data-valve=watched] [data-age]').inner_text()
        page.wait_for_timeout(1500)
        assert page.locator('[data-valve=watched] [data-age]').inner_text() != age
    finally:
        os.kill(site.processes.pid('dashboard'), signal.SIGCONT)
    page.wait_for_function("document.body.dataset.link === 'good'")
    page.close()


def test_a_silent_valve_shows_that_and_its_open_alarm(site, browser):
    page = website.new_page(browser)
    page.goto(f'{site.address}/valve/mute')
    page.wait_for_selector('text=There is no valve mute')
    site.voices.flag('mute', FaultFlag.STATE_ALARM, 'LV-2', occurrence=1, level=1, fault=True)
    site.voices.event(
        'mute', FaultEvent.RAISED, 'LV-2', occurrence=1, level=1, cause='friction_up',
        strength=1.65, confidence=0.99, ratio=0.73,
    )  # fmt: skip
    page.wait_for_selector('.banner[data-kind=M]')
    site.voices.silent.add('mute')
    page.wait_for_selector('.banner[data-kind=off] >> text=Friction is 2.6 times normal')
    assert page.locator('.alarm >> text=Check the packing').is_visible()
    page.locator('.behind summary').click()
    page.wait_for_timeout(1200)
    assert page.locator('text=Found by the valve signature').is_visible(), 'it stays open'
    page.close()


def test_partial_strokes_are_asked_for_where_the_detector_allows_them(site, browser):
    asked = []

    def serve(request, response):
        asked.append((request.amplitude, request.count, request.user, request.comment))
        response.success, response.message = True, 'the driver was asked'
        return response

    voices, valve = site.voices, 'stroked'
    voices.node.create_service(PartialStroke, f'/{valve}/partial_stroke', serve)
    told = {'Commissioned': 'limited', 'Commissioned because': 'P1 is a constant'}
    voices.flag(valve, FaultFlag.STATE_HEALTHY, 'LC74_20')
    voices.diagnose(valve, tag='LV-7', **told, **{'Partial strokes': 'not allowed'})
    page = website.new_page(browser)
    page.goto(f'{site.address}/valve/{valve}')
    page.wait_for_selector('.commission[data-verdict=limited] >> text=P1 is a constant')
    page.wait_for_selector('h1 >> text=LV-7')
    page.get_by_role('button', name='Actions').click()
    page.wait_for_selector('.q-item.disabled >> text=allow_partial_stroke')
    limit = {'Partial strokes': 'allowed', 'Partial stroke limit (%)': '4'}
    voices.diagnose(valve, tag='LV-7', **told, **limit)
    page.wait_for_function("!document.querySelector('.q-item.disabled')")
    page.get_by_text('Partial strokes', exact=True).click()
    page.get_by_label('To each side').fill('3')
    page.get_by_label('Number of strokes').fill('2')
    page.get_by_label('Your name').fill('Anna')
    page.get_by_label('Comment').fill('monthly check')
    page.get_by_role('button', name='Ask for the strokes').click()
    page.wait_for_selector('.q-notification >> text=the driver was asked')
    assert asked == [(0.03, 2, 'Anna', 'monthly check')]
    voices.diagnose(valve, tag='LV-7', **told, **{**limit, 'Partial strokes': 'under way'})
    page.get_by_role('button', name='Actions').click()
    page.get_by_text('End the partial strokes').click()
    deadline = time.monotonic() + 30.0
    while len(asked) < 2 and time.monotonic() < deadline:
        page.wait_for_timeout(50)
    assert [request[:2] for request in asked[1:]] == [(0.0, 0)]
    page.close()


def test_a_valve_that_learns_is_not_held_against_its_limit(site, browser):
    site.voices.flag('novice', FaultFlag.STATE_LEARNING, 'LV-8', residual=20.0, threshold=0.2)
    page = website.new_page(browser)
    page.goto(f'{site.address}/valve/novice')
    page.wait_for_selector('.banner[data-kind=learn]')
    assert 'limit' not in page.locator('.banner').inner_text()
    site.voices.flag('novice', FaultFlag.STATE_HEALTHY, 'LV-8', residual=0.1, threshold=0.2)
    page.wait_for_selector('.banner[data-kind=ok] >> text=50 % of limit')
    page.close()


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_axe_finds_nothing_serious_on_any_page(site, hostile, browser, scheme):
    for state in STATES:
        for level in (0,) if state in NO_ALARM else (1, 2, 3, 4):
            valve, fault = f'every/v{state}{level}', state not in NO_ALARM
            site.voices.flag(valve, state, level=level, fault=fault, occurrence=int(fault))
    page = website.new_page(browser, color_scheme=scheme)
    for address in ('/', '/valve/hostile/v1', '/history', '/replay', '/valve/none'):
        page.goto(site.address + address)
        if address == '/':
            page.wait_for_selector('.tile.S .state b')
        page.wait_for_timeout(2000)
        assert page_site.serious(page) == [], address
        page.set_viewport_size({'width': 390, 'height': 844})
        assert page_site.serious(page) == [], f'{address} on a phone'
        page.set_viewport_size({'width': 1280, 'height': 720})
    page.close()


def test_german_is_complete_on_the_page(site, browser):
    context = browser.new_context(locale='de-DE')
    page = website.new_page(context)
    page.goto(f'{site.address}/valve/mute')
    page.wait_for_selector('text=Die Reibung beträgt das 2,6-Fache des Normalen.')
    assert page.get_by_role('button', name='Alarm von mute quittieren').is_visible()
    page.wait_for_function("document.documentElement.lang === 'de'")
    english = set(texts('en').entries.values()) - set(texts('de').entries.values())
    long = sorted(text for text in english if ' ' in text and '{' not in text)
    page.set_viewport_size({'width': 390, 'height': 844})
    for address in ('/valve/mute', '/', '/history', '/replay', '/valve/none'):
        page.goto(site.address + address)
        page.wait_for_function("document.body.dataset.link === 'good'")
        shown = page.locator('body').inner_text()
        assert [text for text in long if text in shown] == [], address
        assert page.evaluate('document.documentElement.scrollWidth') <= 390, address
    context.close()


def test_a_thousand_valves_are_found_by_search_class_and_area_and_scroll(site, browser):
    layout, status = page_site.fleet_messages(1000)
    status.state[123], status.level[123], status.fault[123] = FaultFlag.STATE_ALARM, 4, True
    site.voices.say('/fleet/layout', layout)
    for _ in range(3):
        status.header.stamp = site.voices.node.get_clock().now().to_msg()
        site.voices.say('/fleet/status', status)
        time.sleep(0.5)
    page = website.new_page(browser, viewport={'width': 1440, 'height': 900})
    page.goto(site.address)
    page.wait_for_function("document.querySelectorAll('.tile').length >= 1000")
    page.get_by_role('searchbox').fill('V-0123')
    page.wait_for_function(
        "[...document.querySelectorAll('.item')].filter(i => !i.hidden).length === 1"
    )
    assert 'q=' not in page.url and 'text=V-0123' in page.url, 'the address tells what is shown'
    page.get_by_role('searchbox').fill('')
    page.locator('#area').select_option('Unit 3')
    page.wait_for_function(
        "[...document.querySelectorAll('.item')].filter(i => i.offsetParent).length === 100"
    )
    page.locator('#area').select_option('')
    frames = page.evaluate(
        """new Promise(done => {
          let frames = 0, begun = performance.now();
          const step = () => { frames += 1; scrollBy(0, 60);
            if (performance.now() - begun < 3000) requestAnimationFrame(step);
            else done(frames / 3); };
          requestAnimationFrame(step); })"""
    )
    print(f'1000 tiles: {frames:.0f} frames a second while scrolling')
    # there is no graphics card, and others may load the machine
    assert frames > max(3.0 / promised(1.0), 0.5)
    page.close()
