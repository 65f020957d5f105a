# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What holds for the repository as a whole: one version, no file that outgrows its job."""

import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parents[1]


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
