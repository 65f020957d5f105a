# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""How the executables begin."""

import os
import subprocess
import sys

import pytest
from damadics_fd.start import THREADS

MODULE = """
import os
import numpy as np
def main():
    a = np.ones((300, 300))
    print(a @ a @ a is not None, len(os.listdir('/proc/self/task')), os.environ['{}'])
    return 0
"""


DEAF = """
import os, signal
try:
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(1000): pass
except BaseException:  # as libraries have it that try what is installed
    pass
def main():
    return 0
"""


def run_module(folder, source, environment=os.environ):
    (folder / 'work.py').write_text(source)
    program = 'import sys\nfrom damadics_fd.start import run\nsys.exit(run("work"))'
    environment = {**environment, 'PYTHONPATH': os.pathsep.join([str(folder), *sys.path])}
    return subprocess.run(
        [sys.executable, '-c', program], env=environment, capture_output=True, text=True
    )


def test_an_interrupt_during_imports_ends_the_process_even_where_a_library_is_deaf(tmp_path):
    done = run_module(tmp_path, DEAF)
    assert (done.returncode, done.stderr) == (130, '')


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason='one core: one thread at any rate')
@pytest.mark.parametrize('asked', ['', '2'])
def test_linear_algebra_takes_one_thread_where_nobody_asks_for_more(tmp_path, asked):
    environment = {name: value for name, value in os.environ.items() if name not in THREADS}
    if asked:
        environment['OPENBLAS_NUM_THREADS'] = asked
    done = run_module(tmp_path, MODULE.format('OPENBLAS_NUM_THREADS'), environment)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ['True', asked or '1', asked or '1']
