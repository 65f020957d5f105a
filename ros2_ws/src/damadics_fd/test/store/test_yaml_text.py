# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""YAML of people and of others: one error for all that is wrong with it, never a dead process."""

import subprocess
import sys

import pytest
import yaml
from damadics_fd.store.fleet_file import FleetError, read_fleet
from damadics_fd.store.yaml_text import read_yaml


def test_what_is_read():
    text = 'a: 1\nb: [x, 0.5, true, null]\nc: {d: "no"}\ne: &same {f: 1}\ng: *same\n'
    assert read_yaml(text) == yaml.safe_load(text)
    assert read_yaml('') is None


@pytest.mark.parametrize(
    ('text', 'why'),
    [
        ('lv1: {period: 1}\nlv2: {}\nlv1: {period: 2}', 'lv1 stands twice'),
        ('a: {b: 1, b: 1}', 'b stands twice'),
        ('a: [', 'did not find'),
        ('a: 2026-13-01', 'month'),
        ('a: !!python/object/apply:os.system [x]', 'could not determine a constructor'),
        ('? [x]\n: 1', 'unhashable'),
        ('a\0b', 'unacceptable character'),
        *((deep * 300, 'nested too deeply') for deep in ('[', '{a: ', '- ', '? ')),
    ],
)
def test_what_is_refused(text: str, why: str):
    with pytest.raises(yaml.YAMLError, match=why):
        read_yaml(text)


def test_a_file_nested_without_end_ends_no_process(tmp_path):
    """The fast reader of the library goes down with its process at some ten thousand."""
    path = tmp_path / 'fleet.yaml'
    path.write_text('[' * 200_000)
    code = (
        'import sys; from damadics_fd.store.fleet_file import *\n'
        'try: read_fleet(sys.argv[1])\n'
        'except FleetError as problem: print(problem)'
    )
    told = subprocess.run([sys.executable, '-c', code, path], capture_output=True, text=True)
    assert 'nested too deeply' in told.stdout, told


def test_a_list_of_valves_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / 'fleet.yaml'
    path.write_bytes(b'\xff\xfe\x00valves')
    with pytest.raises(FleetError, match='not a text file'):
        read_fleet(path)
