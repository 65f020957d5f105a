# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The name of a file for any tag of an actuator."""

import hashlib
from urllib.parse import quote

LONGEST = 120  # characters; file systems take 255 bytes, and suffixes follow
DIGEST = 16


def file_name(tag: str) -> str:
    """
    Return a name that is one part of a path, whatever the tag is.

    Letters and digits of ASCII, "-", "_", "~" and "." stay, everything else is percent-encoded,
    so that no two tags share a file. A leading dot is encoded too. What gets too long ends in a
    hash of the tag.

    :param tag: of an actuator, a valve or a recording.
    :return: the name, without suffix.

    >>> file_name('LV/101')
    'LV%2F101'
    >>> file_name('..')
    '%2E.'
    """
    name = quote(tag.encode('utf-8', 'surrogatepass'), safe='') or '%'
    if name.startswith('.'):
        name = '%2E' + name[1:]
    if len(name) > LONGEST:
        digest = hashlib.sha256(tag.encode('utf-8', 'surrogatepass')).hexdigest()[:DIGEST]
        name = f'{name[: LONGEST - DIGEST - 1]}-{digest}'
    return name
