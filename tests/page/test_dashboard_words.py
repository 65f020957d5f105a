# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What the page says of commissioning, tags, residuals and trends, without a browser."""

import ast
import inspect
import math
import re
import textwrap
import time

import numpy as np
import pytest
from alarm_events import event
from damadics_dashboard.dashboard import main as dashboard
from damadics_dashboard.live.trend_points import TrendPoints
from damadics_dashboard.live.valve import Valve
from damadics_dashboard.pages.charts import time_plot
from damadics_dashboard.pages.fleet_page import tile
from damadics_dashboard.pages.playback import Truth
from damadics_dashboard.pages.replay_page import truth_words
from damadics_dashboard.pages.valve.trend_card import points_of
from damadics_dashboard.report.content import Sources, valve_report
from damadics_dashboard.store.history import History
from damadics_dashboard.words.answers import answer_words, result_words
from damadics_dashboard.words.commission import commission_words
from damadics_dashboard.words.findings import headline
from damadics_dashboard.words.texts import texts, use_causes
from damadics_dashboard.words.valve_words import history_rows, reason_of
from damadics_fd.commands.commission import checks, verdict
from damadics_fd.commands.commission import monitor as commission_monitor
from damadics_fd.core.approximator.estimator import Estimator
from damadics_fd.core.decision import requests
from damadics_fd.core.quality import Reason, Refused
from damadics_fd.core.scada.laws import identify as commission_scada
from damadics_fd.core.scada.laws import plausible
from damadics_fd.core.scada.monitor import ScadaMonitor
from damadics_fd.nodes import partial_strokes
from damadics_fd.nodes.frozen_position import FrozenPosition
from damadics_fd.nodes.input_watch import InputWatch
from damadics_fd.store.intervals import Intervals, Series
from damadics_fd.store.trends import TrendFile
from damadics_msgs.msg import FaultEvent, FaultFlag

EN, DE = texts('en'), texts('de')
ENGLISH = re.compile(r'\b(the|is|are|of|that|not|with|than)\b')


def test_the_verdict_of_commission_is_told_in_the_readers_language():
    told = {
        'Commissioned': 'limited',
        'Friction change found within an hour (%)': '18.5',
        'Stiffness change found within an hour (%)': '2',
        'Commissioned because': 'P1 is a constant\x1b that somebody typed in',
    }
    words = commission_words(told, EN)
    assert (words.verdict, words.title) == ('limited', 'Commissioned: limited.')
    assert '18.5 %' in words.finds and '2 %' in words.finds
    assert words.because == 'P1 is a constant that somebody typed in'
    assert '18,5 %' in commission_words(told, DE).finds
    assert commission_words({'Commissioned': 'no'}, EN).title == 'Not commissioned.'
    assert commission_words({}, EN).verdict == '', 'a detector that tells nothing'
    assert commission_words({'Commissioned': '<b>'}, EN).verdict == 'no'


def test_the_tag_that_the_nodes_were_given_counts_more_than_that_of_a_driver():
    valve, flag = Valve('lv101'), FaultFlag(state=FaultFlag.STATE_HEALTHY)
    flag.header.frame_id = 'LC74_20'
    valve.take_flag(flag, 0.0)
    valve.take_tag('actuator')  # the name that nodes have without one
    assert valve.tag == 'LC74_20'
    valve.take_tag('LV-101')
    valve.take_flag(flag, 1.0)
    assert valve.tag == 'LV-101'


def test_the_detectors_trend_is_taken_over_by_the_tag_of_the_nodes(tmp_path):
    series = TrendFile(tmp_path / 'signatures', 'LV-101', 'abc')
    series.add(1_700_000_000 * 10**9, [0.1, 2.0, 0.3], [0.01, 1.0, 0.02])
    points = TrendPoints(Intervals(tmp_path / 'trends.sqlite'), [tmp_path / 'signatures'])
    valve = Valve('lv101')
    for tag in ('LC74_20', 'LV-101'):
        valve.take_tag(tag)
        points.take(valve)
    assert points.intervals.valves() == ['lv101']
    points.close()


def test_a_report_names_the_tag_after_a_restart_too(tmp_path):
    history = History(tmp_path / 'history.sqlite')
    history.keep_tag('lv101', 'LV-100')
    history.keep_tag('lv101', 'LV-101')
    history.close()
    history, trends = History(tmp_path / 'history.sqlite'), Intervals(tmp_path / 'trends.sqlite')
    assert history.tags() == {'lv101': 'LV-101'}
    report = valve_report(Sources(history, trends), 'lv101', 0.0, 1e9, EN)
    assert report.title == 'Report on lv101 LV-101' and ('Tag', 'LV-101') in report.facts
    assert ('Time with data', '–') in report.facts, 'no trend yet is not 0 s'
    history.close()
    trends.close()


@pytest.mark.parametrize('text', ['raised 1: velocity residual 1.02 x threshold', ''])
def test_the_history_says_what_is_wrong_in_words_and_not_the_programmers(text):
    row = {**event(FaultEvent.RAISED, text), 'ratio': 1.02, 'cause': ''}
    (shown,) = history_rows([row], EN)
    assert shown['text'] == 'The valve moves otherwise than learned, up to 102 % of limit.'
    assert 'velocity residual' not in shown['more'] and shown['more'].startswith('Inspect')
    assert headline(row, DE)[0].endswith('bis 102 % der Grenze.')
    (gone,) = history_rows([{**event(FaultEvent.CLEARED, 'cleared 1: ...'), 'duration': 64.0}], DE)
    assert gone['text'] == 'Es dauerte 1 min 4 s.'


def test_a_near_miss_is_a_sentence_and_no_glossary_is_needed():
    (row,) = history_rows([{**event(FaultEvent.NEAR_MISS, 'near miss'), 'ratio': 0.93}], DE)
    assert row['text'] == (
        'Das Residuum stieg auf 93 % der Grenze und fiel wieder; es gab keinen Alarm.'
    )


def sentences(module, wanted):
    """Return what a module answers, with numbers where it fills something in."""
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        for text in wanted(node):
            if isinstance(text, ast.Constant) and isinstance(text.value, str):
                yield text.value
            elif isinstance(text, ast.JoinedStr):
                parts = (p.value if isinstance(p, ast.Constant) else '7' for p in text.values)
                yield ''.join(map(str, parts))


def answers(node):
    if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == 'Answer':
        yield node.args[1]


def refusals(node):
    if isinstance(node, ast.FunctionDef) and node.name == '_refusal':
        for inner in ast.walk(node):
            if isinstance(inner, ast.Return):
                yield inner.value


@pytest.mark.parametrize(('module', 'wanted'), [(requests, answers), (partial_strokes, refusals)])
def test_what_nodes_answer_is_told_in_the_readers_language(module, wanted):
    found = [text for text in sentences(module, wanted) if text]
    assert len(found) >= 8
    for text in found:
        assert answer_words(text, 'de') != text, text
        assert answer_words(text, 'en') == text
    row = {'result': 'there is no alarm to reset', 'done': False}
    assert result_words(row, DE) == 'abgelehnt: Es gibt keinen Alarm zurückzusetzen.'
    assert result_words({'result': 'a word of its own', 'done': True}, DE) == 'a word of its own'


def told(*functions):
    """Return the sentences of functions, with numbers where they fill something in."""
    for function in functions:
        body = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
        notes = {id(n.value) for n in ast.walk(body) if isinstance(n, ast.Expr)}
        inner = {
            id(part)
            for n in ast.walk(body)
            if isinstance(n, ast.JoinedStr)
            for value in n.values
            for part in ast.walk(value)
        }
        for node in ast.walk(body):
            if isinstance(node, ast.Constant) and id(node) not in notes | inner:
                text = node.value
            elif isinstance(node, ast.JoinedStr) and id(node) not in inner:
                text = ''.join(
                    v.value if isinstance(v, ast.Constant) else '7' for v in node.values
                )
            else:
                continue
            if isinstance(text, str) and text.count(' ') >= 2:
                yield text.removeprefix('7: ')


SENTENCES = {
    'why a valve is not commissioned well': (
        verdict.parts_differ,
        verdict.another_valve,
        verdict.another_plug,
        verdict.unchecked,
        checks.dead_signals,
        commission_monitor._limited,
        commission_scada._missed,
        commission_scada._second_half,
        plausible.possible,
        plausible.check_stem,
        plausible.check_flow,
    ),
    'what an estimator says of itself': (
        Estimator.status.fget,
        ScadaMonitor.strange.fget,
        FrozenPosition.problem.fget,
        InputWatch.lateness.fget,
        InputWatch.problem.fget,
    ),
}


@pytest.mark.parametrize('functions', SENTENCES.values(), ids=SENTENCES)
def test_what_nodes_and_commission_say_is_told_in_the_readers_language(functions):
    found = list(told(*functions))
    assert len(found) >= 8
    for text in found:
        words = answer_words(text, 'de')
        assert words != text and not ENGLISH.search(words), f'{text!r} becomes {words!r}'
        assert answer_words(text, 'en') == text


def test_why_samples_are_refused_is_told_in_the_readers_language():
    for reason in list(Reason)[1:]:
        refused = Refused(reason, 'x1 = 7')
        for text in (refused.explanation, refused.remedy):
            assert not ENGLISH.search(answer_words(text, 'de')), text


def test_one_sentence_of_several_clauses_is_found_among_others():
    learning = 'learning, 18 %: insufficient excitation, 1.25 of 2.00 strokes travelled; move the '
    learning += 'valve both ways'
    said = f'an alarm stands; no limit can be proposed: {learning}; record longer; a word; '
    said += 'p1 is the constant 3.5 Pa: it is not measured'
    assert answer_words(said, 'de') == (
        'ein Alarm steht an; Es lässt sich keine Grenze vorschlagen: lernt, 18 %: zu wenig '
        'bewegt: 1,25 von 2,00 Hüben; das Ventil in beide Richtungen bewegen; länger aufzeichnen; '
        'a word; p1 ist die Konstante 3,5 Pa: es wird nicht gemessen'
    )


@pytest.mark.parametrize('hostile', ['a; ' * 333, 'raised a: ' * 100, 'on hold: x; ' * 80])
def test_a_sentence_that_somebody_made_up_does_not_hold_up_the_page(hostile):
    began = time.process_time()
    answer_words(hostile, 'de')
    assert time.process_time() - began < 1.0


def test_a_valve_that_learns_for_long_says_why():
    valve = Valve('lv101')
    valve.take_flag(FaultFlag(state=FaultFlag.STATE_LEARNING), 100.0)
    valve.diagnostics['estimator'] = {
        'Learning progress (%)': '18',
        'Message': 'learning, 18 %: insufficient excitation, 1.25 of 2.00 strokes travelled; '
        'move the valve both ways',
    }
    valve.levels['estimator'], valve.told_at['estimator'] = 1, 100.0
    condition = valve.condition(100.1, 0)
    assert reason_of(valve, condition, EN, 100.1) == (
        '18 % of the fault-free valve is learned: insufficient excitation, 1.25 of 2.00 strokes '
        'travelled; move the valve both ways'
    )
    assert reason_of(valve, condition, DE, 100.1).endswith('in beide Richtungen bewegen')
    valve.diagnostics['estimator']['Message'] = 'learning, 18 %'
    assert reason_of(valve, condition, EN, 100.1) == '18 % of the fault-free valve is learned'


def test_a_valve_that_is_not_monitored_shows_no_residual_of_before():
    valve = Valve('lv101')
    valve.take_flag(FaultFlag(state=FaultFlag.STATE_HEALTHY, residual=0.4, threshold=0.5), 100.0)
    assert tile(valve, EN, 100.1, 0)['ratio'] == '80 % of limit'
    told = tile(valve, EN, 200.0, 0)
    assert (told['kind'], told['ratio'], told['share']) == ('off', '', 0.0)


def test_a_point_of_a_trend_that_stands_alone_is_drawn():
    start = np.array([0.0, 900.0, 90_000.0])
    ones = np.ones(3)
    found = Series(start, 900.0, ones, ones, ones, ones, [])
    drawn = points_of(found, ones)
    parts = [[]]
    for moment, value in drawn:
        if value is None:
            parts.append([])
        else:
            parts[-1].append(moment)
    assert [len(part) > 1 for part in parts] == [True, True], 'a line needs two points'
    assert points_of(found, ones, 9000.0)[-2:] == [[85_950.0, 1.0], [94_950.0, 1.0]]
    assert points_of(Series(start[:0], 900.0, *[ones[:0]] * 4, []), ones[:0]) == []


def test_the_legend_names_each_curve_once_and_no_edge_of_a_band():
    names = ['Least', 'Mean', 'Greatest', 'Limit', 'Limit']
    options = time_plot(names, '%', bands=('Least', 'Greatest'), dashed=('Limit',))
    assert options['legend']['data'] == ['Mean', 'Limit']
    assert [s['name'] for s in options['series']] == names


def test_what_was_simulated_is_told_in_the_readers_language():
    assert truth_words(None, EN) == ''
    assert truth_words(Truth(4, 70.0, 1.87), EN) == (
        'fault f4 was simulated from 70.00 s, flagged 1.87 s later'
    )
    assert truth_words(Truth(4, 70.0, math.nan), DE) == (
        'Fehler f4 wurde ab 70,00 s simuliert, nicht gemeldet'
    )
    assert truth_words(Truth(0), DE) == 'kein Fehler wurde simuliert'


def test_the_texts_of_causes_can_be_edited_and_a_mistake_is_named(tmp_path, capsys):
    file = tmp_path / 'causes.yaml'
    file.write_text(
        'causes: {friction_up: {text: "Friction of {value} too much.", advice: "Call Bert."}}\n'
    )
    row = {'cause': 'friction_up', 'strength': 1.65}
    try:
        use_causes(file)
        assert headline(row, texts('en'))[2] == 'Call Bert.'
        assert headline(row, texts('de'))[2] == 'Call Bert.'
        assert headline({**row, 'cause': 'spring_softer'}, texts('de'))[0].startswith('Die Feder')
    finally:
        use_causes(None)
    file.write_text('causes: {friktion: {text: "x"}}\n')
    assert dashboard(['--causes', str(file)]) == 2
    assert 'no such cause: friktion' in capsys.readouterr().err
    assert headline(row, texts('en'))[2] != 'Call Bert.'


def test_the_tile_says_why_a_valve_is_not_monitored():
    valve = Valve('lv101')
    valve.take_flag(FaultFlag(state=FaultFlag.STATE_NOT_MONITORING), 100.0)
    assert tile(valve, EN, 100.1, 0)['why'].startswith('the input is silent or refused')
    cause = 'the input has failed: out_of_range: x1 = 55, for 4 s: check transmitter'
    valve.diagnostics['estimator'] = {'Message': cause, 'Publishers': '1'}
    valve.levels['estimator'], valve.told_at['estimator'] = 2, 100.0
    assert tile(valve, EN, 100.1, 0)['why'] == cause
    valve.diagnostics['estimator']['Publishers'] = '2'
    assert tile(valve, EN, 100.1, 0)['why'] == '2 nodes send its measurement: only one may'
    valve.take_flag(FaultFlag(state=FaultFlag.STATE_NOT_MONITORING), 110.0)
    assert 'refused' in tile(valve, EN, 110.1, 0)['why'], 'what an estimator told that has died'
