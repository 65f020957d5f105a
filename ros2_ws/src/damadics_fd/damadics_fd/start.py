# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where the executables begin: before the imports that take seconds and may fail."""

import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

from damadics_fd.leave import INTERRUPTED, ending
from damadics_fd.ros.process.sockets import listen_on_sockets

# numba takes these in wherever they are installed, for what no kernel of ours calls: a tenth of a
# node's start and 30 MB
UNUSED = ('scipy', 'cffi')
THREADS = ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')


def run(module: str) -> int:
    """
    Run the `main` of a module as this process.

    :param module: its name.
    :return: its exit code; 130 where Ctrl-C comes while it is imported, 2 where the middleware
        that the environment asks for is not installed.
    """
    one_thread()
    listen_on_sockets()
    return ending(lambda: _main(module))


def one_thread() -> None:
    """
    Have linear algebra done in one thread, unless the environment says otherwise.

    Matrices are long and narrow here: more threads take twice the CPU time for the same answer,
    whose last bits would depend on the number of cores. To be called before numpy is imported.
    """
    for name in THREADS:
        os.environ.setdefault(name, '1')


def run_node(module: str) -> int:
    """
    Run a module that judges samples, without the libraries that it has no use for.

    :param module: as for `run`.
    :return: as from `run`.
    """
    for name in UNUSED:
        sys.modules.setdefault(name, None)  # type: ignore[arg-type]
    return run(module)


def _main(module: str) -> int:
    with ended_by_ctrl_c():
        problem = missing_middleware()
        if problem:
            print(problem, file=sys.stderr)
            return 2
        main: Callable[[], int] = import_module(module).main
    return main()


@contextlib.contextmanager
def ended_by_ctrl_c() -> Iterator[None]:
    """
    Have Ctrl-C end the process at once, with code 130 and without a word.

    An exception would not do while libraries are imported: they try what is installed, and some
    go on after any exception. Nothing is open yet that would have to be closed.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield  # as in the background of a shell
        return
    signal.signal(signal.SIGINT, lambda *_: os._exit(INTERRUPTED))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def missing_middleware() -> str:
    """
    Tell that another middleware is asked for than is installed; rcl would end with code 102.

    :return: one sentence with the remedy, '' where all is well.
    """
    wanted = os.environ.get('RMW_IMPLEMENTATION', '')
    index = Path('share', 'ament_index', 'resource_index', 'rmw_typesupport')
    folders = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    installed = sorted(
        {
            file.name
            for folder in folders
            if folder and (Path(folder) / index).is_dir()
            for file in (Path(folder) / index).iterdir()
            if file.name != 'rmw_implementation'
        }
    )
    if not wanted or not installed or wanted in installed:
        return ''
    return (
        f'RMW_IMPLEMENTATION={wanted}, but this middleware is not installed; there is '
        f'{", ".join(installed)}: unset RMW_IMPLEMENTATION, or install ROS 2 with it'
    )


def estimator() -> int:
    """Run the node `estimator`."""
    return run_node('damadics_fd.nodes.estimator_node')


def detector() -> int:
    """Run the node `detector`."""
    return run_node('damadics_fd.nodes.detector_node')


def fleet() -> int:
    """Run the node `fleet`."""
    return run_node('damadics_fd.nodes.fleet.fleet_node')


def monitors() -> int:
    """Run the nodes of many valves."""
    return run_node('damadics_fd.nodes.monitors')


def recorder() -> int:
    """Run the recorder."""
    return run('damadics_fd.commands.record')


def replay() -> int:
    """Run the command `replay`."""
    return run('damadics_fd.commands.replay.replay')


def commission() -> int:
    """Run the command `commission`."""
    return run('damadics_fd.commands.commission.command')
