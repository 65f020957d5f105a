# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
import json

import pytest
from damadics_fd.commands.settings import main
from damadics_fd.core.settings.settings import Settings


@pytest.mark.parametrize('mode', ['paper', 'monitor', 'scada'])
def test_the_list_has_what_the_mode_reads(mode, capsys):
    assert main(['--list', '--mode', mode, '--json']) == 0
    rows = json.loads(capsys.readouterr().out)
    read = {row['name'] for row in Settings.describe(mode) if mode in row['modes']}
    assert {row['name'] for row in rows} == read
    assert all(row['description'] for row in rows)
    assert main(['--list', '--mode', mode, '--of', 'valve']) == 0
    text = capsys.readouterr().out
    assert ('stiffness' in text) == ('stiffness' in read) and 'level_failure' not in text


def test_a_name_that_is_none_is_refused_with_a_suggestion(capsys):
    assert main(['tlearn']) == 2
    assert 'do you mean t_learn?' in capsys.readouterr().err
    assert main(['t_learn']) == 0
    assert 't_learn' in capsys.readouterr().out
