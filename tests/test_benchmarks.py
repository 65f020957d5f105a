# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Benchmarks take minutes and are no tests: what they use of the rest must be there."""

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]
BENCHMARKS = sorted((ROOT / 'benchmarks').glob('*.py'))
OURS = {file.stem for folder in ('benchmarks', 'tests') for file in (ROOT / folder).glob('*.py')}


def is_ours(module: str) -> bool:
    return module.startswith('damadics_') or module in OURS


def missing(tree: ast.Module) -> list[str]:
    """List what a program names of our modules that they do not have."""
    lost, modules = [], {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if is_ours(alias.name) and '.' not in alias.name:
                    modules[alias.asname or alias.name] = import_module(alias.name)
        elif isinstance(node, ast.ImportFrom) and node.module and is_ours(node.module):
            module = import_module(node.module)
            for alias in node.names:
                name = f'{node.module}.{alias.name}'
                if hasattr(module, '__path__') and find_spec(name):
                    import_module(name)
                found = getattr(module, alias.name, None)
                if found is None:
                    lost.append(name)
                elif isinstance(found, ModuleType):
                    modules[alias.asname or alias.name] = found
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = modules.get(node.value.id)
            if module and not hasattr(module, node.attr):
                lost.append(f'{module.__name__}.{node.attr}')
    return lost


@pytest.mark.parametrize('file', BENCHMARKS, ids=lambda file: file.name)
def test_what_a_benchmark_uses_of_ours_is_there(file, monkeypatch):
    monkeypatch.syspath_prepend(file.parent)
    assert missing(ast.parse(file.read_text(encoding='utf-8'))) == []


def test_what_is_not_there_is_told():
    tree = ast.parse('import website\nfrom conftest import nothing\nwebsite.picture, website.no')
    assert missing(tree) == ['conftest.nothing', 'website.no']
