# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The examples in the docstrings."""

import doctest
import importlib
import pkgutil

import damadics_plant
import pytest

NODE = 'damadics_plant.plant'
MODULES = sorted(
    {m.name for m in pkgutil.walk_packages(damadics_plant.__path__, 'damadics_plant.')} - {NODE}
)


@pytest.mark.parametrize('name', MODULES)
def test_examples(name):
    result = doctest.testmod(importlib.import_module(name))
    assert result.failed == 0
