# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The door for text from outside: cut to a length, without control characters."""

NAME = 100  # characters of a tag, a user, a topic
COMMENT = 200  # of what a person remarks
SENTENCE = 1000  # of an event's text or advice
CUT = '…'
LOOK_AHEAD = 4  # what is read of a text that is too long, in multiples of its limit


def plain(text: str, limit: int = COMMENT) -> str:
    """
    Return a text from outside as one line that is safe to log, to keep and to show.

    Control characters (ESC too), marks of the writing direction, invisible and unassigned
    characters and halves of surrogate pairs go; every run of white space and line breaks becomes
    one blank; what is then too long ends in "…". Markup is left as it is: who shows the text as
    HTML has to escape it.

    :param text: as it came in.
    :param limit: characters at most.
    :return: at most `limit` characters.

    >>> plain('packing  replaced  ')
    'packing replaced'
    >>> plain('abcdef', 4)
    'abc…'
    """
    near = text[: LOOK_AHEAD * limit]
    kept = ''.join(c if c.isprintable() else ' ' if c.isspace() else '' for c in near)
    line = ' '.join(kept.split())
    if len(line) > limit or len(near) < len(text):
        return line[: limit - 1].rstrip() + CUT
    return line
