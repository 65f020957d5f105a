# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every package imports is what it states, and packages depend in one direction."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from damadics_fd.commands import evaluate

SOURCES = Path(__file__).resolve().parents[1] / 'ros2_ws' / 'src'
PACKAGES = sorted(file.parent.name for file in SOURCES.glob('*/package.xml'))
ORDER = {  # a package knows only those of a lower floor
    'damadics_msgs': 0,
    'damadics_fd': 1,
    'damadics_plant': 2,
    'damadics_evaluate': 3,
    'damadics_connect': 3,
    'damadics_dashboard': 4,
    'damadics_bringup': 5,
}
DISTRIBUTIONS = {
    'sklearn': 'scikit-learn',
    'distributed': 'dask',
    'yaml': 'pyyaml',
    'google': 'protobuf',
    'prometheus_client': 'prometheus-client',
    'paho': 'paho-mqtt',
    'fpdf': 'fpdf2',
}
KEYS = {'PIL': 'python3-pil', 'dask': 'python3-dask'}
IMPLIED = {'rosidl_default_runtime', 'ros2cli', 'ros2launch'}  # run, never imported


def imported(package):
    """Modules of others that the sources of a package import, wherever the import stands."""
    found = {}
    for file in (SOURCES / package).rglob('*.py'):
        inside = file.relative_to(SOURCES / package)
        if inside.parts[0] in ('test', 'build', 'install') or file.name == 'setup.py':
            continue
        for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module]
            for name in names:
                found.setdefault(name.split('.')[0], inside)
    return {
        name: file
        for name, file in found.items()
        if name not in sys.stdlib_module_names and name != package
    }


def stated(package):
    """Keys in package.xml that hold at run time."""
    root = ElementTree.parse(SOURCES / package / 'package.xml').getroot()
    return {
        element.text.strip() for tag in ('depend', 'exec_depend') for element in root.findall(tag)
    }


def by_pip(package):
    """Distributions in setup.py: what rosdep does not know, and what is optional."""
    file = SOURCES / package / 'setup.py'
    if not file.exists():
        return set()
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
        if isinstance(node, ast.keyword) and node.arg in ('install_requires', 'extras_require'):
            names |= {
                re.split(r'[\[<>=!~; ]', leaf.value)[0].lower()
                for leaf in ast.walk(node.value)
                if isinstance(leaf, ast.Constant) and isinstance(leaf.value, str)
            }
    return names


def key_of(module):
    return KEYS.get(module, f'python3-{module}')


@pytest.mark.parametrize('package', PACKAGES)
def test_every_import_is_stated(package):
    keys, pip = stated(package), by_pip(package)
    missing = [
        f'{file} imports {name}: state {name} or {key_of(name)} in package.xml, or the '
        'distribution in setup.py where rosdep has none'
        for name, file in sorted(imported(package).items())
        if not {name, key_of(name)} & keys
        and not {name.lower(), DISTRIBUTIONS.get(name, name).lower()} & pip
    ]
    assert not missing, '\n'.join(missing)


@pytest.mark.parametrize('package', PACKAGES)
def test_nothing_is_stated_that_no_source_imports(package):
    if package == 'damadics_msgs':
        assert not imported(package)
        return
    modules = imported(package)
    used = {*modules, *map(key_of, modules)}
    files = [f for d in ('launch', 'config') for f in (SOURCES / package / d).glob('**/*')]
    texts = ''.join(f.read_text(encoding='utf-8') for f in files if f.suffix in ('.py', '.yaml'))
    unused = {key for key in stated(package) - used - IMPLIED if key not in texts}
    assert not unused, f'{package}/package.xml states {", ".join(sorted(unused))}'


@pytest.mark.parametrize('package', PACKAGES)
def test_packages_depend_one_way(package):
    own = {name for name in imported(package) if name.startswith('damadics_')}
    assert own <= ORDER.keys(), 'give every package its floor in ORDER'
    wrong = {name for name in own if ORDER[name] >= ORDER[package]}
    assert not wrong, f'{package} imports {", ".join(sorted(wrong))}'


def test_the_former_name_hands_its_arguments_over(monkeypatch, capsys, tmp_path):
    index = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages'
    index.mkdir(parents=True)
    (index / 'damadics_evaluate').touch()
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    program = tmp_path / 'ros2'
    program.write_text('#!/bin/sh\n')
    program.chmod(0o755)
    monkeypatch.setenv('PATH', str(tmp_path))
    monkeypatch.setattr(sys, 'argv', ['evaluate', 'run', '--out', 'a b'])
    calls = []
    monkeypatch.setattr(os, 'execv', lambda path, argv: calls.append((path, list(argv))) or 0)
    assert evaluate.main() == 0
    wanted = ['ros2', 'run', 'damadics_evaluate', 'evaluate', 'run', '--out', 'a b']
    assert calls == [(str(program), wanted)]
    assert 'damadics_evaluate evaluate' in capsys.readouterr().err


def test_the_former_name_says_what_is_not_installed(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    assert evaluate.main() == 2
    assert 'damadics_evaluate is not installed' in capsys.readouterr().err


def test_the_former_name_imports_nothing_that_evaluates():
    code = (
        'import sys, damadics_fd.commands.evaluate;'
        'print([m for m in sys.modules if m.split(".")[0] in'
        ' ("damadics_evaluate", "damadics_plant", "numpy", "numba", "matplotlib")])'
    )
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True, env=environment
    )
    assert done.stdout.strip() == '[]'
