#!/usr/bin/env python3
# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write a version where ROS and citations want it: `python tools/set_version.py 0.3.0`."""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def main(version: str) -> int:
    """
    Write the version into every package.xml and CITATION.cff; setup.py reads package.xml.

    :param version: three numbers with points.
    :return: exit code.
    """
    if not re.fullmatch(r'\d+\.\d+\.\d+', version):
        print(f'set_version: {version!r} is not of the form 0.3.0', file=sys.stderr)
        return 2
    for path in ROOT.glob('ros2_ws/src/*/package.xml'):
        text = re.sub(r'<version>[^<]*<', f'<version>{version}<', path.read_text())
        path.write_text(text)
    citation = ROOT / 'CITATION.cff'
    citation.write_text(re.sub(r'(?m)^version: .*$', f'version: {version}', citation.read_text()))
    return 0


if __name__ == '__main__':
    if len(sys.argv) != 2:
        sys.exit('usage: python tools/set_version.py 0.3.0')
    sys.exit(main(sys.argv[1]))
