# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""What docs/paper.md points to is there."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'docs' / 'paper.md').read_text()


def test_every_function_that_the_page_names_exists():
    places = re.findall(r'`(damadics_\w+/[\w/]+\.py)`((?:: `\w+`)?(?:, `\w+`)*)', PAGE)
    assert len(places) >= 10
    for file, names in places:
        text = (ROOT / 'ros2_ws' / 'src' / file).read_text()
        for name in re.findall(r'`(\w+)`', names):
            assert re.search(rf'^def {name}\(', text, re.MULTILINE), f'{name} in {file}'


def test_every_equation_of_the_paper_is_on_the_page():
    stated = set()
    for first, last in re.findall(r'^\| \((\d+)\)(?:[-,] ?\((\d+)\))?', PAGE, re.MULTILINE):
        stated |= set(range(int(first), int(last or first) + 1))
    assert stated == set(range(1, 17))


def test_links_of_the_page_lead_somewhere():
    links = re.findall(r'\]\(([^)#]+)', PAGE)
    assert links
    for link in links:
        assert (ROOT / 'docs' / link).exists(), link
