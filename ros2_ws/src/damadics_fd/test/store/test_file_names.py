# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Any tag makes a file name; none leaves its folder and no two share one."""

from pathlib import Path

import pytest
from damadics_fd.store.file_names import file_name
from hypothesis import given, settings
from hypothesis import strategies as st

ANY = st.text(st.characters(codec=None), max_size=300)


@settings(deadline=None)  # a busy machine pauses longer than one example may take
@given(ANY)
def test_any_tag_is_one_part_of_a_path(tag):
    name = file_name(tag)
    assert 0 < len(name) <= 120
    assert name.isascii()
    assert name.isprintable()
    assert Path('/f', f'{name}.json').parent == Path('/f')
    assert name not in ('.', '..')
    assert not name.startswith('.')


@settings(deadline=None)  # a busy machine pauses longer than one example may take
@given(ANY, ANY)
def test_no_two_tags_share_a_file(one, other):
    assert (file_name(one) == file_name(other)) == (one == other)


@pytest.mark.parametrize('tag', ['LC74_20', 'LV-101', 'lv101', 'FV~1.2'])
def test_ordinary_tags_keep_their_name(tag):
    assert file_name(tag) == tag
