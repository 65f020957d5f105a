# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The front door: env.sh, the ros2 command without ROS 2, and refusals of setup_env.py."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import PATIENCE

ROOT = Path(__file__).resolve().parents[1]
STAND_IN = ROOT / 'tools' / 'bin' / 'ros2'
stand_in_only = pytest.mark.skipif(
    shutil.which('ros2') != str(STAND_IN), reason='an installed ROS 2 is used here'
)


def shell(command: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a new bash that knows nothing of this process but the home."""
    clean = {'PATH': '/usr/local/bin:/usr/bin:/bin', 'HOME': os.environ.get('HOME', '/')}
    return subprocess.run(
        ['bash', '-c', command],
        cwd='/',
        env=clean,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )


def sourced(command: str) -> subprocess.CompletedProcess[str]:
    """Run a command after `source env.sh` in a new shell."""
    return shell(f'source {ROOT}/env.sh && {command}')


def test_env_sh_puts_packages_and_messages_on_the_path():
    done = sourced('python -c "import damadics_msgs.msg, damadics_fd, rclpy; print(1)"')
    assert (done.returncode, done.stdout) == (0, '1\n'), done.stderr


def test_env_sh_may_be_sourced_twice():
    once = sourced('echo $PATH $LD_LIBRARY_PATH $AMENT_PREFIX_PATH')
    twice = sourced(f'source {ROOT}/env.sh; echo $PATH $LD_LIBRARY_PATH $AMENT_PREFIX_PATH')
    assert once.stdout == twice.stdout


def test_env_sh_without_a_build_says_what_to_do(tmp_path):
    shutil.copy(ROOT / 'env.sh', tmp_path)
    done = shell(f'source {tmp_path}/env.sh')
    assert done.returncode != 0
    assert 'make build' in done.stderr


def test_ros2_pkg_executables_lists_the_nodes():
    done = sourced('ros2 pkg executables damadics_fd')
    assert done.returncode == 0
    assert {'damadics_fd detector', 'damadics_fd estimator', 'damadics_fd recorder'} <= set(
        done.stdout.splitlines()
    )


def test_ros2_pkg_prefix_and_list():
    prefix = sourced('ros2 pkg prefix damadics_fd').stdout.strip()
    assert Path(prefix, 'lib', 'damadics_fd', 'detector').is_file()
    share = sourced('ros2 pkg prefix --share damadics_msgs').stdout.strip()
    assert Path(share, 'msg', 'Measurement.msg').is_file()
    names = sourced('ros2 pkg list').stdout.split()
    assert names == sorted(names)
    assert {'damadics_msgs', 'damadics_plant', 'rclpy', 'std_msgs'} <= set(names)


@pytest.mark.parametrize(
    ('command', 'says'),
    [
        ('ros2 run no_such_package detector', "Package 'no_such_package' not found"),
        ('ros2 run damadics_fd no_such_executable', 'No executable found: there are'),
        ('ros2 run damadics_fd detectr', 'No executable found: do you mean detector?'),
        ('ros2 run damadics_df detector', "'damadics_df' not found: do you mean damadics_fd?"),
        ('ros2 pkg prefix no_such_package', 'Package not found'),
        ('ros2 pkg executables no_such_package', "Package 'no_such_package' not found"),
    ],
)
def test_ros2_errors_are_those_of_the_real_command(command, says):
    done = sourced(command)
    assert done.returncode == 1
    assert says in done.stderr


@stand_in_only
@pytest.mark.parametrize('verb', ['topic list', 'launch x y', 'bag play x', 'node --help'])
def test_other_verbs_say_that_they_need_ros(verb):
    done = sourced(f'ros2 {verb}')
    assert done.returncode == 1
    assert 'needs an installed ROS 2 Jazzy' in done.stderr


@stand_in_only
def test_ros2_run_hands_over_arguments_and_exit_code():
    done = sourced('ros2 run --prefix "bash -c \'exit 7\'" damadics_fd detector')
    assert done.returncode == 7
    done = sourced('ros2 run --prefix echo damadics_fd detector --help -x "a b"')
    assert done.stdout.strip().endswith('/lib/damadics_fd/detector --help -x a b')


FORMER = (
    'damadics_fd',
    'evaluate',
)  # names the command that took its place, tests/test_packages.py


def installed() -> list[str]:
    return [
        f'{path.parent.name} {path.name}'
        for path in sorted((ROOT / 'ros2_ws' / 'install').glob('*/lib/damadics_*/*'))
        if (path.parent.name, path.name) != FORMER
    ]


@pytest.mark.parametrize('command', installed())
def test_every_command_explains_itself_with_an_example(command):
    done = sourced(f'ros2 run {command} --help')
    assert done.returncode == 0, done.stderr
    assert f'ros2 run {command}' in done.stdout
    assert done.stderr == ''


@pytest.mark.parametrize(
    'command',
    [
        'damadics_fd estimator',
        'damadics_fd detector',
        'damadics_plant plant',
        'damadics_fd monitors estimator -- plant --ros-args',
    ],
)
def test_a_node_refuses_words_that_it_would_not_see(command):
    done = sourced(f'timeout 30 ros2 run {command} mode:=paper')
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(f'{command.split()[1]}: error: ')


def test_real_ros2_wins(tmp_path):
    real = tmp_path / 'ros2'
    real.write_text('#!/bin/sh\necho the real one\n')
    real.chmod(0o755)
    done = shell(f'PATH={tmp_path}:$PATH; source {ROOT}/env.sh && ros2 run x y')
    assert done.stdout == 'the real one\n'


@pytest.fixture
def fresh(tmp_path):
    """Copy tools/ to where nothing is set up yet; return how to run its setup_env.py."""
    shutil.copytree(ROOT / 'tools', tmp_path / 'tools')

    def run(**environment: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, tmp_path / 'tools' / 'setup_env.py'],
            env={**os.environ, 'ROS_DISTRO': '', **environment},
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )

    return run


def test_setup_without_a_compiler_names_the_remedy(fresh, tmp_path):
    done = fresh(PATH=str(tmp_path))
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1
    assert 'there is no cc' in done.stderr
    assert 'apt-get install g++' in done.stderr
    assert not (tmp_path / '.venv').exists()


def test_setup_under_another_distribution_names_the_remedy(fresh):
    done = fresh(ROS_DISTRO='humble')
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1
    assert 'humble is sourced' in done.stderr


def test_setup_is_done_once_only():
    clean = {k: v for k, v in os.environ.items() if k not in ('ROS_DISTRO', 'MAKEFLAGS')}
    done = subprocess.run(
        ['make', '-s', 'env', f'PYTHON={Path(sys.prefix, "bin", "python")}'],
        cwd=ROOT,
        env=clean,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (done.returncode, done.stdout) == (0, ''), done.stderr


@pytest.mark.parametrize('another', ['/opt/python/cp311-cp311', '/somebody/clone/.venv'])
def test_setup_repairs_exported_paths_in_this_environment_only(tmp_path, monkeypatch, another):
    monkeypatch.syspath_prepend(ROOT / 'tools')
    import setup_env

    exported = tmp_path / 'share' / 'std_msgs' / 'cmake' / 'std_msgsExport.cmake'
    exported.parent.mkdir(parents=True)
    before = (
        f'INTERFACE_INCLUDE_DIRECTORIES "${{_IMPORT_PREFIX}}/include/std_msgs;'
        f'{another}/include/python3.11;{another}/lib/site-packages/numpy/_core/include"\n'
    )
    cached = tmp_path / 'cache'
    cached.write_text(before)
    exported.hardlink_to(cached)
    (tmp_path / 'bin').mkdir()
    (tmp_path / 'bin' / 'python').symlink_to(ROOT / '.venv' / 'bin' / 'python')
    monkeypatch.setattr(setup_env, 'VENV', tmp_path)
    assert setup_env.repair_exported_paths() == 1
    assert cached.read_text() == before, 'the cache is shared with other environments'
    first, python, numpy = exported.read_text().split('"')[1].split(';')
    assert first == '${_IMPORT_PREFIX}/include/std_msgs'
    assert Path(python, 'Python.h').is_file()
    assert Path(numpy, 'numpy', 'arrayobject.h').is_file()


def test_every_requirement_is_pinned_with_hashes_and_no_address():
    folder = ROOT / 'tools' / 'requirements'
    locked = (folder / 'constraints.txt').read_text()
    assert '://' not in locked
    pins = {
        line.split()[0].partition('==')[0]: line.split()[0]
        for line in locked.splitlines()
        if line and line[0] not in '# '
    }
    for file in folder.glob('*.txt'):
        if file.name == 'constraints.txt':
            continue
        for line in file.read_text().splitlines():
            name, pinned, version = line.partition('==')
            if pinned and not line.startswith('#'):
                plain = name.partition('[')[0].lower()
                assert pins[plain] == f'{plain}=={version}', f'{file.name}: run make lock'
    blocks = locked.split('\n    --hash=sha256:')
    assert len(blocks) > len(pins) > 100
    assert all(
        f'{pin} ' in locked and f'{pin} \\\n    --hash' in locked or ';' in locked
        for pin in pins.values()
    )
