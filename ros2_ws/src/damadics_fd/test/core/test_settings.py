# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings: what describes the valve and what tunes a mode; what a mode does not read."""

import numpy as np
import pytest
import yaml
from damadics_fd.core.modes import MODES
from damadics_fd.core.settings import Settings, SettingsError
from damadics_fd.core.settings.document import ValveDocument, parameters_in

pytestmark = pytest.mark.plain

ROWS = [row for row in Settings.describe() if row['name'] != 'mode']
TOGETHER = {  # settings that bound one another: what has to change with them
    'decide_m': {'decide_n': 64},
    'decide_n': {'decide_m': 1},
    'level_maintenance': {'level_specification': 1e6, 'level_failure': 1e6},
    'level_specification': {'level_failure': 1e6},
    'delta': {'dz': 5.0, 'rho_min': 9.0},
    'dz': {'rho_min': 9.0},
    't_on': {'t_w': 1e5, 't_learn': 1e6},
    't_w': {'t_learn': 1e6},
    'consistent': {'velocity': 'super_twisting'},
}


def changed(row, mode):
    """Return another value than the mode's default that is allowed."""
    default = row['default']
    if 'choices' in row:
        return next(c for c in row['choices'] if c != default)
    if row['type'] is bool:
        return not default
    if row['type'] is tuple:
        return [*default[:-1], default[-1] / 2.0]
    for value in (default * 1.01 + 1e-3, default * 0.99, row['low'], row['high']):
        value = row['type'](value)
        if row['low'] <= value <= row['high'] and value != default:
            return value
    raise AssertionError(row)


@pytest.mark.parametrize('mode', MODES)
@pytest.mark.parametrize('name', [row['name'] for row in ROWS])
def test_each_setting_reaches_the_record_of_a_mode_or_is_refused_by_name(name, mode):
    row = next(row for row in Settings.describe(mode) if row['name'] == name)
    value = changed(row, mode)
    if mode not in row['modes']:
        assert row['describes'] == 'mode', 'what describes the valve is accepted in every mode'
        with pytest.raises(SettingsError, match=f'^{name}: mode {mode} does not read it'):
            Settings.for_mode(mode, **{name: value})
        return
    before = Settings.for_mode(mode)
    bounds = {k: v for k, v in TOGETHER.get(name, {}).items() if mode in MODES_OF[k]}
    after = before.replace(**bounds).replace(**{name: value})
    assert after.record().tobytes() != before.replace(**bounds).record().tobytes()


MODES_OF = {row['name']: row['modes'] for row in ROWS}


def test_what_is_refused_is_refused_in_files_too_and_all_at_once():
    with pytest.raises(SettingsError) as error:
        Settings.from_mapping({'mode': 'scada', 'k2': 5.0, 'alpha1': 1.0, 'nonsense': 1})
    assert [text.split(':')[0] for text in error.value.problems] == ['nonsense', 'k2', 'alpha1']


@pytest.mark.parametrize('given', [{'plug_table': [10**400] * 12}, {'mass': 10**400}])
def test_a_whole_number_beyond_any_float_is_refused_by_name(given):
    with pytest.raises(SettingsError, match=next(iter(given))):
        Settings.for_mode('monitor', **given)


@pytest.mark.parametrize('mode', MODES)
def test_settings_come_back_from_plain_data(mode):
    settings = Settings.for_mode(mode, mass=3, plug_table=[1] * 12)
    assert Settings.from_mapping(settings.to_dict()) == settings
    assert settings.valve().mass == 3.0


@pytest.mark.parametrize(
    ('air_to', 'flow_to', 'signs'),
    [('close', 'open', (1, 1)), ('open', 'open', (-1, 1)), ('close', 'close', (1, -1))],
)
def test_the_action_gives_the_signs(air_to, flow_to, signs):
    settings = Settings.for_mode('monitor', air_to=air_to, flow_to=flow_to)
    record = settings.record()[0]
    assert np.sign((record.area_per_force, record.plug_per_force)).tolist() == list(signs)
    # the spring holds the vented valve at the end that the air leaves
    x = 0.0 if air_to == 'close' else 1.0
    away = -(x + record.spring_origin) * (1 if air_to == 'close' else -1)
    assert away == -settings.preload


def test_the_file_of_a_valve_says_what_differs_and_comes_back():
    settings = Settings.for_mode('scada', air_to='open', kv=40.0, plug_table=[0.9] * 12)
    document = ValveDocument(settings, 'LV-101', 'references/LV-101')
    content = yaml.safe_load(yaml.safe_dump(document.plain()))
    named = set(content['/**']['ros__parameters'])
    assert named == {'mode', 'actuator', 'air_to', 'kv', 'plug_table'}
    assert ValveDocument.read(content) == document
    content['/**/detector'] = {'ros__parameters': {'alarm_folder': '', 'latch': False}}
    read = ValveDocument.read(content)
    assert (read.settings.latch, read.actuator) == (False, 'LV-101')
    assert ValveDocument.read(content, 'monitor').settings.mode == 'monitor'
    content['/**/commission'] = {'ros__parameters': {'verdict': 'ok', 'misfit': 0.1}}
    content['/**/plant'] = {'ros__parameters': {'twin': {'kv': 1.0}, 'kv': 1.0}}
    assert ValveDocument.read(content) == read
    assert {'verdict', 'twin'}.isdisjoint(parameters_in(content))


@pytest.mark.parametrize('content', [None, [], {'/**': None}, {'/**': {'ros__parameters': []}}])
def test_a_file_without_parameters_is_refused(content):
    with pytest.raises(SettingsError, match='ros__parameters'):
        ValveDocument.read(content)


@pytest.mark.parametrize(
    ('wrong', 'word'),
    [({'t_learn': 200.0}, 't_learn'), ({'t_w': 700.0}, 't_learn'), ({'stem_play': 0.04}, 'play')],
)
def test_what_makes_no_monitor_of_a_control_room_is_refused_with_the_other_settings(wrong, word):
    with pytest.raises(SettingsError, match=word):
        Settings.for_mode('scada', **wrong)
