# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The examples in the docstrings."""

import doctest
import importlib
import pkgutil

import damadics_plant
import pytest

MODULES = sorted({m.name for m in pkgutil.iter_modules(damadics_plant.__path__)} - {'plant'})


@pytest.mark.parametrize('name', MODULES)
def test_examples(name):
    result = doctest.testmod(importlib.import_module(f'damadics_plant.{name}'))
    assert result.failed == 0
