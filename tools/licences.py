#!/usr/bin/env python3
# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""List every installed package with its version and licence; `make licences`."""

import re
import sys
from importlib.metadata import Distribution, distributions
from pathlib import Path
from xml.etree import ElementTree

LONGEST = 60  # characters of a licence; some packages put its whole text there
STRONG = re.compile(r'\b(A?GPL|GNU (Affero )?General)')


def licence_of(package: Distribution) -> str:
    """
    Find what a package says of its licence.

    :param package: installed distribution.
    :return: SPDX expression or name, "not stated" where there is none.
    """
    about = package.metadata
    classified = [
        line.rpartition('::')[2].strip()
        for line in about.get_all('Classifier') or []
        if line.startswith('License ::')
    ]
    stated = about.get('License-Expression') or (about.get('License') or '').strip()
    lines = stated.splitlines() or ['']
    first = lines[0].strip() if len(lines[0]) <= LONGEST else ''
    return first or ' / '.join(classified) or of_ros(about['Name']) or 'not stated'


def of_ros(name: str) -> str:
    """
    Read the licence of a package of ROS out of its package.xml.

    :param name: of the wheel or the package, such as ros-jazzy-std-msgs or std_msgs.
    :return: licence, '' where there is no such file.
    """
    short = name.removeprefix('ros-').removeprefix('jazzy-').replace('-', '_')
    file = Path(sys.prefix, 'share', short, 'package.xml')
    if not file.is_file():
        return ''
    found = ElementTree.parse(file).iterfind('license')
    return ' / '.join((element.text or '').strip() for element in found)


def main() -> int:
    """
    Print the table.

    :return: 0.
    """
    rows = sorted(
        {
            (package.metadata['Name'].lower(), package.version, licence_of(package))
            for package in distributions()
        }
    )
    width = max(len(name) for name, _, _ in rows)
    for name, version, licence in rows:
        print(f'{name:<{width}}  {version:<14} {licence}')
    strong = [
        name for name, _, licence in rows if STRONG.search(licence) and 'LGPL' not in licence
    ]
    unknown = [name for name, _, licence in rows if licence == 'not stated']
    print(f'\n{len(rows)} packages; GPL or AGPL: {", ".join(strong) or "none"}')
    print(f'without a statement of their licence: {", ".join(unknown) or "none"}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
