# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Configurations: what is wrong is told, and a thousand valves take no time."""

import os
import subprocess
import sys

import pytest
from damadics_connect.settings import ConfigError, read_config


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
