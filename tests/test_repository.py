# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What holds for the repository as a whole: one version, no file that outgrows its job."""

import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parents[1]
MOST_LINES = 350
MOST_FILES = 16  # of a package folder, __init__ included


def tracked(*patterns):
    """List the files that git knows, or those in place where this is no checkout."""
    done = subprocess.run(
        ['git', 'ls-files', '--', *patterns], cwd=ROOT, capture_output=True, text=True
    )
    if done.returncode:
        pytest.skip('this is no git checkout')
    return [ROOT / name for name in done.stdout.splitlines() if (ROOT / name).is_file()]


def test_the_version_is_the_same_everywhere():
    versions = {
        path.parent.name: ElementTree.parse(path).findtext('version')
        for path in ROOT.glob('ros2_ws/src/*/package.xml')
    }
    versions['CITATION.cff'] = re.search(
        r'(?m)^version: (.*)$', (ROOT / 'CITATION.cff').read_text()
    )[1]
    versions['CHANGELOG.md'] = re.search(
        r'(?m)^## (\d+\.\d+\.\d+)', (ROOT / 'CHANGELOG.md').read_text()
    )[1]
    assert len(set(versions.values())) == 1, versions


def test_no_setup_file_repeats_the_version():
    for path in ROOT.glob('ros2_ws/src/*/setup.py'):
        assert "findtext('version')" in path.read_text(), path


def test_no_python_file_is_too_long():
    long = {
        str(path.relative_to(ROOT)): lines
        for path in tracked('*.py')
        if (lines := len(path.read_text().splitlines())) > MOST_LINES
    }
    assert not long


def test_no_package_folder_holds_too_many_files():
    counts = {}
    for path in tracked('ros2_ws/src/*.py'):
        if '/test/' not in path.as_posix():
            counts[path.parent] = counts.get(path.parent, 0) + 1
    full = {str(p.relative_to(ROOT)): n for p, n in counts.items() if n > MOST_FILES}
    assert not full


def test_the_page_on_architecture_names_every_room():
    page = (ROOT / 'docs/architecture.md').read_text()
    tables = re.findall(r'(?ms)^(\| room of `(\w+).*?)\n\n', page)
    nameless = []
    for path in {path.parent for path in tracked('ros2_ws/src/*.py')}:
        package, *rooms = path.relative_to(ROOT / 'ros2_ws/src').parts
        if rooms[:1] == [package] and rooms[1:]:
            named = ''.join(table for table, of in tables if of == package)
            if not re.search(rf'`([\w.]+/)*{rooms[-1]}/?`', named):
                nameless.append(str(path.relative_to(ROOT)))
    assert not nameless


def test_no_file_names_a_place_of_one_machine_or_a_registry():
    words = r'(^|[^A-Za-z0-9_.])/(work|farm|root)/|index-url|"resolved": *"https?:'
    done = subprocess.run(
        ['git', 'grep', '-nIE', words, '--', '.', ':!tests/test_repository.py'],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    if done.returncode > 1:
        pytest.skip('this is no git checkout')
    assert not done.stdout


def test_no_file_points_at_a_sheet_that_no_reader_has():
    words = r'sheet (section|step)s?|"""Section [0-9]'
    places = [
        f'{path.relative_to(ROOT)}: {line.strip()}'
        for path in tracked('*.py')
        if path.name != 'test_repository.py'
        for line in path.read_text().splitlines()
        if re.search(words, line)
    ]
    assert not places
