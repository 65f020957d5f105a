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


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason='one core: one thread at any rate')
@pytest.mark.parametrize('asked', ['', '2'])
def test_linear_algebra_takes_one_thread_where_nobody_asks_for_more(tmp_path, asked):
    (tmp_path / 'work.py').write_text(MODULE.format('OPENBLAS_NUM_THREADS'))
    environment = {name: value for name, value in os.environ.items() if name not in THREADS}
    environment['PYTHONPATH'] = os.pathsep.join([str(tmp_path), *sys.path])
    if asked:
        environment['OPENBLAS_NUM_THREADS'] = asked
    program = 'import sys\nfrom damadics_fd.start import run\nsys.exit(run("work"))'
    done = subprocess.run(
        [sys.executable, '-c', program], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ['True', asked or '1', asked or '1']
