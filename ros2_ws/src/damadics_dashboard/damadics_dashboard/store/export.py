# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Values for a spreadsheet."""


def cell(value: object) -> object:
    """
    Return a value as a cell: a text that a spreadsheet would run as a formula is quoted.

    :param value: number or text.
    :return: the same, or a text that begins with an apostrophe.

    >>> cell('=1+1'), cell(-2.0)
    ("'=1+1", -2.0)
    """
    if isinstance(value, str) and value[:1] in ('=', '+', '-', '@', '\t', '\r'):
        return f"'{value}"
    return value
