# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""A process ends with its own exit code, whatever the middleware does at the end."""

import os
import subprocess
import sys

import pytest

SOURCES = {**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}
SOURCES.pop('PYTHONUNBUFFERED', None)
STUCK = """
import ctypes
from damadics_fd import leave
leave.PATIENCE = 0.5
libc = ctypes.CDLL(None)
libc.__cxa_atexit(libc.pause, None, None)  # a destructor that never returns
"""
CRASH = STUCK.replace('libc.pause', 'libc.abort').replace('never returns', 'crashes')
OTHERS = """
import atexit, threading, time
atexit.register(print, 'called at the end')
go = threading.Event()
def work():
    go.wait()
    time.sleep(0.2)
    print('joined')
threading.Thread(target=work).start()
go.set()
"""


def end_of(body: str, before: str = '') -> subprocess.CompletedProcess[str]:
    """Run a process whose work is `body`."""
    lines = ''.join(f'    {line}\n' for line in body.strip().splitlines())
    program = (
        'import sys\nfrom damadics_fd.leave import ending\n'
        f'{before}\ndef main():\n{lines}\nsys.exit(ending(main))\n'
    )
    return subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, env=SOURCES
    )


@pytest.mark.parametrize('code', [0, 1, 2, 3])
@pytest.mark.parametrize('before', ['', STUCK], ids=['sound', 'stuck'])
def test_the_exit_code_is_that_of_the_work(code: int, before: str) -> None:
    """Also where a destructor hangs; what was printed is there."""
    end = end_of(f"print('written', end='')\nreturn {code}", before)
    assert (end.returncode, end.stdout, end.stderr) == (code, 'written', '')


@pytest.mark.parametrize('code', [0, 1])
def test_a_destructor_that_crashes_changes_no_exit_code(code: int) -> None:
    """As a damaged heap does when the middleware is taken down."""
    end = end_of(f"print('written', end='')\nreturn {code}", CRASH)
    assert (end.returncode, end.stdout) == (code, 'written')


@pytest.mark.parametrize(
    ('body', 'code', 'words'),
    [
        ("sys.exit('wrong')", 1, 'wrong'),
        ('sys.exit()', 0, ''),
        ('sys.exit(2)', 2, ''),
        ("raise ValueError('odd')", 1, 'ValueError: odd'),
        ('raise KeyboardInterrupt', 130, 'KeyboardInterrupt'),
    ],
)
def test_other_ends_than_a_return(body: str, code: int, words: str) -> None:
    """As the interpreter ends them, with its words."""
    end = end_of(body)
    assert end.returncode == code
    assert words in end.stderr
    assert bool(words) == bool(end.stderr)


def test_threads_are_joined_and_functions_of_atexit_called() -> None:
    """Before the process leaves, as without a middleware."""
    end = end_of(f'{OTHERS}\nreturn 3', STUCK)
    assert (end.returncode, end.stdout) == (3, 'joined\ncalled at the end\n')


def test_output_that_nobody_reads_is_an_error() -> None:
    """As of the interpreter: a pipe that is closed costs the exit code 0."""
    reading, writing = os.pipe()
    os.close(reading)
    program = (
        'import sys\nfrom damadics_fd.leave import ending\n'
        "def main():\n    print('written')\n    return 0\nsys.exit(ending(main))\n"
    )
    end = subprocess.run(
        [sys.executable, '-c', program], stdout=writing, stderr=subprocess.PIPE, env=SOURCES
    )
    os.close(writing)
    assert end.returncode == 120, end.stderr
