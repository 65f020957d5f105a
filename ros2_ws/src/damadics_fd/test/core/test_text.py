# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Text from outside comes in as one line without control characters."""

import pytest
from damadics_fd.core.text import plain
from hypothesis import given, settings
from hypothesis import strategies as st

pytestmark = pytest.mark.plain


@settings(deadline=None)  # a busy machine pauses longer than one example may take
@given(st.text(st.characters(codec=None), max_size=500), st.integers(2, 50))
def test_any_text_becomes_a_short_printable_line(text, limit):
    line = plain(text, limit)
    assert len(line) <= limit
    assert line.isprintable()
    line.encode()  # no half of a surrogate pair
    assert plain(line, limit) == line


@pytest.mark.parametrize(
    ('text', 'line'),
    [
        ('packing\nreplaced', 'packing replaced'),
        ('\x1b[31mred\x1b[0m', '[31mred[0m'),
        ('a\u202eb\u200bc\x00d\u2028e', 'abcd e'),
        ('Ventil 3, Öl wechseln ☂', 'Ventil 3, Öl wechseln ☂'),
        ('\ud800x', 'x'),
        ('', ''),
    ],
)
def test_what_stays(text, line):
    assert plain(text) == line


def test_a_long_text_is_cut_and_says_so():
    assert plain('x' * 1_000_000, 200) == 'x' * 199 + '…'
    assert plain('x' * 200, 200) == 'x' * 200
