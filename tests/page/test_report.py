# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Reports: a valve and a fleet over a period, as people take them away."""

import csv
import io
import math
import re
import resource
import time
from datetime import datetime

import pytest
from damadics_dashboard.live.late_size import SizeKeeper
from damadics_dashboard.report.command import main
from damadics_dashboard.report.content import Sources, alarms_of, known_for, reliability
from damadics_dashboard.report.forms import numeric_columns
from damadics_dashboard.store.history import History
from damadics_fd.store.intervals import DAY, Intervals
from damadics_msgs.msg import FaultEvent, Signature

pypdf = pytest.importorskip('pypdf')
END = 1_790_000_000.0  # s
BEGIN = END - 365 * DAY


def event(valve: str, seen: float, transition: int, **values) -> dict:
    row = {
        'valve': valve, 'stamp': int(seen * 1e9), 'transition': transition, 'occurrence': 1,
        'level': 1, 'onset': int(seen * 1e9), 'residual': 0.4, 'threshold': 0.2, 'ratio': 2.0,
        'duration': 1.0, 'cause': '', 'confidence': None, 'strength': None, 'text': 'raised',
        'advice': '',
    }  # fmt: skip
    return {**row, **values}


@pytest.fixture(scope='module')
def year(tmp_path_factory):
    """A valve-year: a point every quarter of an hour, friction that grows, two alarms."""
    state = tmp_path_factory.mktemp('state')
    trends = Intervals(state / 'trends.sqlite')
    step = 6 * 3600
    for k in range(0, 365 * DAY, step):
        share = k / (365 * DAY)
        values = {'friction': 1.65 * share, 'spring': 0.01 * math.sin(9 * share), 'preload': 2.0}
        std = {'friction': 0.02, 'spring': 0.001}
        trends.add('lv101', BEGIN + k, values, std, '1,0.25,0.05,0.04')
    trends.close()
    history = History(state / 'history.sqlite')
    with pytest.MonkeyPatch.context() as patch:
        for valve, day, kind, more in (
            ('lv101', 100, FaultEvent.RAISED, {}),
            ('lv101', 101, FaultEvent.CLEARED, {'duration': 86400.0, 'unseen': 7200.0}),
            ('lv101', 360, FaultEvent.RAISED, {}),
            ('lv101', 360.1, FaultEvent.CHANGED,
             {'cause': 'friction_up', 'strength': 1.65, 'confidence': 0.99}),
            ('lv102', 200, FaultEvent.RAISED, {'level': 4}),
        ):  # fmt: skip
            seen = BEGIN + day * DAY
            patch.setattr(time, 'time', lambda seen=seen: seen)
            history.add(event(valve, seen, kind, **more))
        patch.setattr(time, 'time', lambda: BEGIN + 361 * DAY)
        action = {'valve': 'lv101', 'action': 'acknowledge', 'user': 'Anna', 'role': 'operator'}
        history.add_action({**action, 'comment': '<b>=1+1</b>', 'done': 1, 'result': 'done'})
    history.keep_tag('lv101', 'LV-101')
    history.close()
    return state


def report(state, out, *words) -> int:
    stamp = time.strftime('%Y-%m-%dT%H:%M:%S', time.localtime(BEGIN))
    until = time.strftime('%Y-%m-%dT%H:%M:%S', time.localtime(END))
    common = ['--from', stamp, '--to', until, '--state', str(state), '--out', str(out)]
    return main([*words, *common])


def test_a_valve_year_tells_cause_size_dates_and_who_did_what(year, tmp_path, capsys):
    began, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert report(year, tmp_path, 'lv101') == 0
    seconds = time.process_time() - began
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    lines = capsys.readouterr().out.splitlines()
    print(f'report of a valve-year: {seconds:.1f} s, {grown:.0f} MB more')
    assert grown < 200.0 and seconds < 20.0  # of a core; others may load the machine
    pages = pypdf.PdfReader(tmp_path / 'report_lv101.pdf').pages
    text = '\n'.join(page.extract_text() for page in pages)
    for wanted in (
        'lv101',
        'Friction is 2.6 times normal.',
        '+165 %',
        'Check the packing',
        'Anna',
        'Greatest',  # no word is parted by the width of its column
        '2 h 0 min of it without data',
        '\n100\n200\n300\n',  # a scale of round numbers
    ):
        assert wanted in text, wanted
    assert time.strftime('%Y-%m-%d', time.localtime(BEGIN)) in text
    assert 'Limit +300 % in about' in text.replace('\n', ' ')
    html = (tmp_path / 'report_lv101.html').read_text()
    assert '&lt;b&gt;=1+1' in html and '<b>=1+1' not in html
    assert html.count('class="before"') == 2 and 'Valve signature' in text, 'both branches'
    assert 'http' not in html.replace('http-equiv', ''), 'it needs nothing else'
    rows = list(
        csv.DictReader(io.StringIO((tmp_path / 'report_lv101.csv').read_text('utf-8-sig')))
    )
    assert [row['cause'] for row in rows] == ['friction_up', '', '', '']
    assert [line.rpartition('.')[2] for line in lines] == ['html', 'pdf', 'csv', 'csv']


def test_tables_on_paper_are_not_filled_with_the_colour_of_a_chart(year, tmp_path):
    assert report(year, tmp_path, 'lv101', '--as', 'pdf') == 0
    fills = []
    for page in pypdf.PdfReader(tmp_path / 'report_lv101.pdf').pages:
        drawn = page.get_contents().get_data().decode('latin1')
        drawn = re.sub(r'(?s)\bq\b.*?\bQ\b', '', drawn)  # texts, each in its own colour
        color = ''
        for found in re.finditer(r'([\d. ]+ rg|[\d.]+ g)\b|\bre\s+f\b', drawn):
            color = found[1] or color
            if not found[1]:
                fills.append([float(x) for x in color.split()[:-1]])
    assert fills and all(min(fill) == 1.0 for fill in fills), fills


def test_numbers_stand_one_under_the_other_and_names_do_not():
    rows = [['Friction', '+165 %', 'in about 190 days'], ['Travel', '30 1/h', '']]
    assert numeric_columns(['Quantity', 'End', 'Outlook'], rows) == [False, True, False]
    assert numeric_columns(['Time', 'Who'], [['1', '']]) == [False, False]


def test_trends_for_a_spreadsheet_have_units_and_times(year, tmp_path):
    assert report(year, tmp_path, 'lv101', '--as', 'csv') == 0
    text = (tmp_path / 'report_lv101_trends.csv').read_text('utf-8-sig')
    rows = list(csv.DictReader(io.StringIO(text)))
    assert {row['quantity']: row['unit'] for row in rows} == {
        'spring': '%', 'preload': 'N', 'friction': '%',
    }  # fmt: skip
    friction = [row for row in rows if row['quantity'] == 'friction']
    assert len(friction) >= 364
    times = [datetime.fromisoformat(row['time']).timestamp() for row in friction]
    assert times == sorted(times) and BEGIN - DAY <= times[0] <= BEGIN + DAY
    for time_of, row in zip(times, friction, strict=True):
        middle = time_of + float(row['length_s']) / 2
        assert float(row['mean']) == pytest.approx(165.0 * (middle - BEGIN) / (365 * DAY), abs=1.0)
        assert float(row['least']) <= float(row['mean']) <= float(row['greatest'])
    assert report(year, tmp_path, 'FLEET', '--as', 'csv') == 0
    assert not (tmp_path / 'report_FLEET_trends.csv').exists(), 'a fleet has none of its own'


def test_the_fleet_lists_the_worst_first_and_counts_by_eemua(year, tmp_path):
    assert report(year, tmp_path, 'FLEET', '--as', 'pdf') == 0
    text = pypdf.PdfReader(tmp_path / 'report_FLEET.pdf').pages[0].extract_text()
    assert text.index('lv102') < text.index('lv101'), 'a failure comes before maintenance'
    assert 'EEMUA 191' in text


def test_german(year, tmp_path):
    assert report(year, tmp_path, 'LV-101', '--as', 'pdf', '--language', 'de') == 0, 'by its tag'
    text = pypdf.PdfReader(tmp_path / 'report_LV-101.pdf').pages[0].extract_text()
    assert 'Die Reibung beträgt das 2,6-Fache des Normalen.' in text


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['lv_101'], 'do you mean lv101?'),
        (['lv101', '--from', 'yesterday'], 'is no date'),
        (['lv101', '--from', '2026-02-01', '--to', '2026-01-01'], 'ends before it begins'),
        (['lv101', '--state', 'nowhere'], 'there is no history'),
    ],
)
def test_what_cannot_be_is_refused_with_a_remedy(year, tmp_path, words, said, capsys):
    assert main(['--state', str(year), '--out', str(tmp_path), *words]) == 2
    assert said in capsys.readouterr().err


def test_a_valve_known_for_minutes_has_no_time_between_alarms_of_weeks(tmp_path):
    trends, history = Intervals(tmp_path / 'trends.sqlite'), History(tmp_path / 'history.sqlite')
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time, 'time', lambda: END - 1200.0)
        history.add(event('lv101', END - 1200.0, FaultEvent.RAISED))
    trends.add('lv101', END - 1800.0, {'friction': 0.1}, {}, '')
    found = known_for(Sources(history, trends), 'lv101', END - 30 * DAY, END)
    assert 1800.0 <= found < 1800.0 + 900.0
    assert known_for(Sources(history, trends), 'lv101', END - 60.0, END) == 60.0
    assert known_for(Sources(history, trends), 'lv999', END - 60.0, END) == 0.0
    trends.close()
    history.close()


def test_a_size_that_becomes_known_after_its_event_is_in_the_report(tmp_path):
    told = event('lv101', END, FaultEvent.CHANGED, cause='friction_up')
    signature = Signature(state=Signature.STATE_ALARM, cause=Signature.CAUSE_FRICTION_UP)
    history = History(tmp_path / 'history.sqlite')
    keeper = SizeKeeper(history)
    signature.value = 1.65
    keeper.keep([told], signature)  # the event is not in the file yet
    history.add(told)
    signature.value = math.nan
    keeper.keep([told], signature)
    assert history.latest()[0]['strength'] is None
    for signature.value in (1.65, 1.70):
        keeper.keep([told], signature)
    assert history.latest()[0]['strength'] == 1.65, 'what was known first stays'
    history.close()


def test_times_between_and_to_clearing():
    rows = [
        {**event('v', seen, kind), 'seen': seen}
        for seen, kind in ((100.0, FaultEvent.RAISED), (160.0, FaultEvent.CLEARED))
    ]
    alarms = alarms_of(rows[::-1])
    assert reliability(alarms, 1000.0) == (940.0, 60.0)
    mtbf, mttr = reliability([], 1000.0)
    assert math.isinf(mtbf) and math.isnan(mttr)
