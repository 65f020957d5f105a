# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A terminal is told what a command is doing; a pipe or a file is not."""

import io
import sys
import time

from damadics_fd.commands import stages
from damadics_fd.commands.commission.command import main
from damadics_fd.commands.stages import CLEAR, Stages


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_stage_is_shown_with_its_seconds_and_gone_before_a_result(monkeypatch):
    monkeypatch.setattr(stages, 'PACE', 0.001)
    screen = Terminal()
    with Stages('commission', screen) as shown:
        shown.tell('reading')
        end = time.monotonic() + 20.0
        while screen.getvalue().count('reading') < 3 and time.monotonic() < end:
            time.sleep(0.001)
        shown.hide()
        before = screen.getvalue()
        assert before.startswith(f'{CLEAR}commission: reading ... 0 s') and before.endswith(CLEAR)
        assert before.count('reading') >= 3, 'it goes on counting'
        time.sleep(0.01)
        assert screen.getvalue() == before, 'nothing is drawn into what is printed'


def test_nothing_is_shown_where_nobody_looks():
    stream = io.StringIO()
    with Stages('commission', stream) as shown:
        shown.tell('reading')
    assert stream.getvalue() == ''


def test_commission_tells_a_terminal_what_it_does(tmp_path, monkeypatch, capsys):
    table = tmp_path / 'short.csv'
    table.write_text('t,cv,x1\n' + ''.join(f'{k},0.5,0.5\n' for k in range(50)))
    words = [str(table), '--mode', 'scada']
    assert main(words) == 1
    plain = capsys.readouterr().err
    assert plain.count('\n') == 1 and CLEAR not in plain
    monkeypatch.setattr(sys, 'stderr', Terminal())
    assert main(words) == 1
    screen = sys.stderr.getvalue()
    assert f'{CLEAR}commission: reading the recordings ... 0 s' in screen
    assert screen.endswith(f'{CLEAR}{plain}')
