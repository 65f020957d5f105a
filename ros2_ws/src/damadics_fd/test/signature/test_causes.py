# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
import math
import re

import pytest
from damadics_fd.causes import LANGUAGES, CauseTableError, explain, load_causes
from damadics_fd.commands.replay.bags import collect
from damadics_fd.core.decision.alarm import CHANGED, RAISED
from damadics_fd.core.decision.events import Event
from damadics_fd.core.signature.state import CAUSES


def test_every_cause_has_a_text_for_known_and_unknown_numbers():
    table = load_causes()
    for name in CAUSES:
        text, _ = table[name].describe('LV-101')
        assert 'LV-101' in text and 'nan' not in text
        text, _ = table[name].describe('LV-101', 0.25, 0.01, 0.99, 'spring_softer')
        assert '{' not in text
    assert table['friction_up'].describe('V', 0.25, 0.01, 0.99)[0] == (
        'V: Friction is 1.2 times normal. (+25 % ± 2 %, confidence 99 %)'
    )
    german = load_causes(language='de')
    assert german['friction_up'].words(1.65, 0.195, 0.99) == (
        'Die Reibung beträgt das 2,6-Fache des Normalen.',
        '+165 % ± 39 %, Wahrscheinlichkeit 99 %',
        'Packung prüfen: Stopfbuchse zu fest, trocken, oder Ablagerungen an der Spindel.',
    )
    for name in CAUSES:
        english, other = table[name], german[name]
        assert (name, other.ne107) == (name, english.ne107)
        assert bool(other.advice) == bool(english.advice) and other.text != english.text


def test_a_users_file_replaces_only_what_it_names(tmp_path):
    file = tmp_path / 'causes.yaml'
    file.write_text(
        'causes: {friction_up: {ne107: failure, advice: "Call {tag} service"}}\n'
        'limits: {friction: [1]}\n'
    )
    table, standard = load_causes(file), load_causes()
    assert table['friction_up'].ne107 == 4
    assert table['friction_up'].describe('V', 1.0, 0.1, 1.0)[1] == 'Call V service'
    assert table['friction_up'].text == standard['friction_up'].text
    assert table['supply'] == standard['supply']
    assert table.limits['friction'] == (1.0,)
    assert table.limits['spring'] == standard.limits['spring']


@pytest.mark.parametrize(
    'content, complaints',
    [
        ('causes: {friktion: {text: a}}', ['no such cause: friktion']),
        ('causes: {supply: {ne107: bad, text: "{valve}"}}', ['ne107', '{valve}']),
        ('causes: {supply: {text: "{value.__class__}"}}', ['unknown field']),
        ('causes: {supply: {text: "{value:q}"}}', ['supply, text']),
        ('causes: {supply: {text: "{value"}}', ['supply, text']),
        ('causes: {supply: {text: 5}}', ['not a text']),
        ('causes: {supply: {texts: a}}', ['expected some of the keys']),
        ('causes: [supply]', ['expected names']),
        ('limits: {spring: [0], speed: [1]}', ['limits of spring', 'no such quantity: speed']),
        ('cause: {}', ['expected the keys']),
        ('[1, 2]', ['expected the keys']),
        ('causes: {', ['not valid YAML']),
    ],
)
def test_a_wrong_file_is_refused_with_every_error(tmp_path, content, complaints):
    file = tmp_path / 'mine.yaml'
    file.write_text(content)
    with pytest.raises(CauseTableError) as error:
        load_causes(file)
    for complaint in (*complaints, 'mine.yaml'):
        assert complaint in str(error.value)


def test_a_strength_that_is_not_known_is_left_out():
    said = load_causes()['supply'].describe('V', math.nan, math.nan, 0.9)[0]
    assert said == 'V: The air supply has changed. (confidence 90 %)'


def event(transition: int, occurrence: int = 1, cause: str = '', level: int = 1, **values):
    return Event(
        transition,
        2_000_000_000,
        occurrence,
        level,
        1_000_000_000,
        1.0,
        0.5,
        2.0,
        1.0,
        cause=cause,
        text='raised',
        **values,
    )


def test_an_event_is_worded_by_its_cause():
    table = load_causes()
    plain = event(RAISED)
    assert explain(plain, table, 'V') is plain
    named = explain(
        event(CHANGED, cause='spring_softer', strength=-0.05, spread=0.001, confidence=0.99),
        table,
        'V',
    )
    assert named.text == (
        'V: The spring is 5.0 % softer than learned. (-5.0 % ± 0.2 %, confidence 99 %) '
        'Found by the threshold, named by the valve signature. [raised]'
    )
    assert 'crack' in named.advice


def test_replay_puts_a_later_cause_into_its_detection():
    found: list[dict] = []
    collect(found, [event(RAISED, cause='undetermined')], 0)
    collect(
        found, [event(CHANGED, cause='friction_up', strength=0.5, spread=0.02, confidence=0.99)], 0
    )
    collect(found, [event(RAISED, 2)], 0)
    collect(found, [event(CHANGED, 1, cause='supply')], 0)
    assert [d['cause'] for d in found] == ['friction_up', '']
    assert found[0]['strength'] == 0.5 and found[0]['spread'] == 0.02
    assert found[0]['text'] == 'raised' and found[1]['strength'] is None


@pytest.mark.parametrize('language', LANGUAGES)
def test_no_text_tells_a_size_that_nobody_knows(language):
    for name, cause in load_causes(language=language).causes.items():
        said = ' '.join(cause.words(confidence=0.9))
        assert not re.search('unknown|unbekannt|nan', said), f'{name}: {said}'


def test_who_words_a_cause_anew_reads_these_words_whatever_is_known(tmp_path):
    own = tmp_path / 'causes.yaml'
    own.write_text('causes: {friction_up: {text: "Packung {factor:.1f}"}}')
    cause = load_causes(own)['friction_up']
    assert cause.words(1.0)[0] == 'Packung 2.0' and cause.words()[0] == 'Packung unknown'
