# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The examples in the docstrings."""

import doctest
import importlib
import importlib.util
from pathlib import Path

import pytest

PACKAGES = ('fd', 'plant', 'connect', 'dashboard', 'evaluate', 'bringup')
COMPILED = 'damadics_fd.core.'  # takes minutes where it is not compiled yet


def with_examples() -> list[str]:
    """Name the modules that show one."""
    found = []
    for package in PACKAGES:
        spec = importlib.util.find_spec(f'damadics_{package}')
        for folder in spec.submodule_search_locations if spec else ():
            for path in sorted(Path(folder).rglob('*.py')):
                if '>>> ' in path.read_text():
                    parts = path.relative_to(Path(folder).parent).with_suffix('').parts
                    found.append('.'.join(parts).removesuffix('.__init__'))
    return [name for name in found if not name.startswith(COMPILED)]


@pytest.mark.parametrize('name', with_examples())
def test_examples(name):
    pytest.importorskip(name)
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted and not result.failed
