# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Read YAML that people write: thousands of entries in a fraction of a second, no name twice."""

import yaml

from damadics_fd.core.record import Plain, Saved

DEEPEST = 100  # mappings and lists within each other; libyaml's own end is that of the process
_Fast = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
_OPENING = (yaml.MappingStartEvent, yaml.SequenceStartEvent)
_CLOSING = (yaml.MappingEndEvent, yaml.SequenceEndEvent)


class _Loader(_Fast):  # type: ignore[misc,valid-type]
    """Refuse a name that stands twice: YAML lets the last one count without a word."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> Saved:
        names: set[str] = set()
        for key, _ in node.value:
            name = str(key.value)
            if name in names:
                raise yaml.constructor.ConstructorError(
                    None, None, f'{name[:80]} stands twice in one mapping', key.start_mark
                )
            names.add(name)
        found: Saved = super().construct_mapping(node, deep)
        return found


def read_yaml(text: str) -> Plain:
    """
    Read one document.

    :param text: the whole file.
    :return: mappings, lists and plain values.
    :raises yaml.YAMLError: where it is no YAML, has a name twice in one mapping, or is nested too
        deeply.

    >>> read_yaml('valves: {lv101: {period: 0.02}}')
    {'valves': {'lv101': {'period': 0.02}}}
    """
    depth = 0
    for event in yaml.parse(text, Loader=_Fast):
        if isinstance(event, _OPENING):
            depth += 1
            if depth > DEEPEST:
                raise yaml.MarkedYAMLError(
                    problem='nested too deeply',
                    problem_mark=event.start_mark,  # type: ignore[arg-type]  # one of two marks
                )
        elif isinstance(event, _CLOSING):
            depth -= 1
    try:
        content: Plain = yaml.load(text, Loader=_Loader)
    except (ValueError, OverflowError) as problem:  # a date with a 13th month, for example
        raise yaml.MarkedYAMLError(problem=str(problem)) from problem
    return content
