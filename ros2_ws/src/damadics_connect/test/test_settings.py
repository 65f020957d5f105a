# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Configurations: what is wrong is told, and a thousand valves take no time."""

import os
import subprocess
import sys
from importlib import import_module

import pytest
from damadics_connect.settings import ConfigError, Section, read_config


@pytest.mark.parametrize(
    ('text', 'why'),
    [
        ('valves:\n  lv1: {}\n  lv2: {}\n  lv1: {}\n', 'line 4: not valid YAML: lv1 stands twice'),
        ('valves: [', 'not valid YAML: did not find'),
        ('[' * 100_000, 'line 1: not valid YAML: nested too deeply'),
        ('a: \0', 'not valid YAML: control characters'),
    ],
)
def test_a_file_that_cannot_be_read_is_refused_in_one_line(tmp_path, text, why):
    path = tmp_path / 'plant.yaml'
    path.write_text(text)
    with pytest.raises(ConfigError, match=why) as told:
        read_config(path)
    assert '\n' not in str(told.value)


SECRET = 'hunter2-hunter2'
URL = f'mailtos://me:{SECRET}@mail.example'
MISTAKES = [  # of people who write a secret where it does not belong
    ('opcua', f'server: opc.tcp://me:{SECRET}@plc', 'has a user in it'),
    ('opcua', f'server: opc.tcp://me:{SECRET}℀@plc', 'is no address'),
    ('opcua', f'server: "opc.tcp://me:{SECRET}@[plc"', 'is no address'),
    ('opcua', f'server: opc.tcp://plc:{SECRET}', 'is no address'),
    (
        'opcua',
        f'server: opc.tcp://p\nuser: {{name: me, password: {SECRET}}}',
        'stands in the file',
    ),
    ('opcua', f'server: opc.tcp://p\nuser: {{name: me, password_file: {SECRET}}}', 'not exist'),
    ('opcua', f'server: opc.tcp://p\nuser: {{name: me, password_env: {SECRET}}}', 'no such var'),
    ('opcua', f'server: opc.tcp://p\nuser: {{password_file: {SECRET * 30}}}', 'too long'),
    ('opcua', f'serve: {{token_file: {SECRET}}}', 'does not exist'),
    ('mqtt', f'broker: mqtt://me:{SECRET}@plant', 'has a user in it'),
    ('mqtt', f'broker: mqtt://me:{SECRET}℀@plant', 'is no address'),
    ('mqtt', f'broker: "mqtt://me:{SECRET}@[plant"', 'is no address'),
    ('mqtt', f'broker: http://me:{SECRET}@plant', 'does not begin with mqtt://'),
    ('mqtt', 'broker: mqtt://', 'names no host'),
    ('http', f'token_file: {SECRET}', 'does not exist'),
    ('notify', f'targets: {{shift: "{URL}"}}', 'write entries'),
    ('notify', f'targets: {{shift: {{url: "{URL}"}}}}', 'stands in the file'),
    ('notify', f'targets: {{shift: {{url_file: "{URL}"}}}}', 'does not exist'),
    ('notify', f'targets: {{shift: {{url_env: "{URL}"}}}}', 'no such variable'),
    ('notify', f'targets: ["{URL}"]', 'is not a mapping'),
    (
        'notify',
        f'targets: {{s: {{url_file: u}}}}\nrules: [{{to: ["{URL}"]}}]',
        'an address is not one of s',
    ),
]


@pytest.mark.parametrize(('command', 'text', 'why'), MISTAKES)
def test_a_secret_in_the_wrong_place_is_not_told_further(
    tmp_path, monkeypatch, capsys, command, text, why
):
    for package in ('asyncua', 'aiomqtt', 'fastapi', 'apprise'):
        pytest.importorskip(package)
    (tmp_path / 'u').write_text(f'{URL}&{SECRET}')
    path = tmp_path / 'plant.yaml'
    path.write_text(text, encoding='utf-8')
    assert import_module(f'damadics_connect.{command}.command').main([str(path)]) == 2
    told = capsys.readouterr()
    assert why in told.err and SECRET not in told.err + told.out


@pytest.mark.parametrize('url', [f'opc.tcp://me:{SECRET}@plc', f'http://{SECRET}', 'opc.tcp://['])
def test_an_address_to_browse_with_a_secret_in_it_is_refused(capsys, url):
    """It would stand in the proposed configuration, and stood in the list of processes."""
    pytest.importorskip('asyncua')
    from damadics_connect.opcua.command import main

    assert main(['--browse', url]) == 1
    told = capsys.readouterr()
    assert told.err.startswith('opcua: --browse: the address ')
    assert SECRET not in told.err + told.out


def test_a_folder_in_the_place_of_tokens_opens_nothing(tmp_path):
    path = tmp_path / 'http.yaml'
    path.write_text('token_file: tokens')
    (tmp_path / 'tokens').mkdir()
    config = read_config(path)
    assert config.tokens().open and 'tokens: Is a directory' in config.problems[0]


def test_a_connector_loads_no_compiler():
    """It judges nothing: numba would make its start a third longer."""
    rooms = ('opcua.source', 'opcua.server', 'http.api', 'mqtt.outgoing', 'notify.rules', 'watch')
    code = 'import sys, ' + ', '.join(f'damadics_connect.{room}' for room in rooms)
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}
    told = subprocess.run(
        [sys.executable, '-c', f'{code}; print(*sys.modules)'],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert not {'numba', 'scipy'} & set(told.stdout.split())


@pytest.mark.parametrize(
    ('value', 'shown'), [(10**400, 'inf'), (-(10**400), '-inf')], ids=['above', 'below']
)
def test_a_whole_number_beyond_any_float_is_refused(value, shown):
    problems: list[str] = []
    assert Section({'port': value}, '', problems).number('port', 80, 1, 65535) == 80
    assert f'{shown} is not within 1 .. 65535' in problems[0]
