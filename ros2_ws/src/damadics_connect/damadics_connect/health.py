# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Say in `/diagnostics` how the valves of a source are."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

from damadics_fd.ros.diagnostics import Level, Report

from damadics_connect.joining import Joiner
from damadics_connect.publishing import Output
from damadics_connect.source_clock import NANO

NAMED = 5  # valves that a message names
LATE = 2.5  # s that changes may come late before it is told; three periods of slow valves


def moment(stamp: int) -> str:
    """
    Word a stamp.

    :param stamp: [ns].
    :return: date and time in UTC.

    >>> moment(1_000_000_000_000_000_000)
    '2001-09-09 01:46:40.000Z'
    """
    try:
        when = datetime.fromtimestamp(stamp / NANO, UTC)
    except (ValueError, OverflowError, OSError):
        return f'{stamp / NANO:.3f} s'
    return f'{when:%Y-%m-%d %H:%M:%S}.{when.microsecond // 1000:03d}Z'


def some(names: Sequence[str]) -> str:
    """
    List names, not too many.

    :param names: any number.
    :return: the first and how many more.

    >>> some(['a', 'b', 'c', 'd', 'e', 'f', 'g'])
    'a, b, c, d, e and 2 more'
    """
    more = f' and {len(names) - NAMED} more' if len(names) > NAMED else ''
    return ', '.join(names[:NAMED]) + more


def report(
    fault: str,
    joiners: Mapping[str, Joiner],
    output: Output,
    values: Mapping[str, object],
    problems: Sequence[str] = (),
    now: int = 0,
) -> Report:
    """
    Sum a source up.

    :param fault: why nothing comes at all, '' while it comes.
    :param joiners: of every valve by name.
    :param output: where the samples go.
    :param values: further key-values.
    :param problems: further things that are not well.
    :param now: as given to the joiners [ns]; 0: how late changes come is not told.
    :return: level, sentence and key-values for `Diagnostics`.
    """
    tallies = {name: joiner.tally for name, joiner in joiners.items()}
    missing = [f'{n} {s}' for n, joiner in joiners.items() for s in joiner.waiting_for]
    bad = [f'{n} {s}: {why}' for n, tally in tallies.items() for s, why in tally.bad.items()]
    uncertain = [f'{n} {s}' for n, tally in tallies.items() for s in tally.uncertain]
    gaps = [(tally.last_gap, name) for name, tally in tallies.items() if tally.gaps]
    still = [name for name, tally in tallies.items() if tally.still]
    late = {n: joiner.lateness(now) / NANO for n, joiner in joiners.items()} if now else {}
    behind = [n for n, by in late.items() if by > max(LATE, 3 * joiners[n].period)]
    told = {
        **values,
        'Samples': output.samples,
        'Samples of held values': sum(tally.held for tally in tallies.values()),
        'Values late': sum(tally.late for tally in tallies.values()),
        'Changes after a held sample of their time': sum(t.overtaken for t in tallies.values()),
        'Changes come late by [s]': f'{max(late.values(), default=0.0):.1f}',
        'Values sent twice': sum(tally.repeated for tally in tallies.values()),
        'Stamps in the future': sum(tally.future for tally in tallies.values()),
        'Changes with the time of long before': sum(tally.still for tally in tallies.values()),
        'Clock steps of the source': sum(tally.steps for tally in tallies.values()),
        'Gaps': sum(tally.gaps for tally in tallies.values()),
        'Missing': some(missing),
        'Bad': some(bad),
        'Uncertain': some(uncertain),
    }
    if gaps:
        (begin, end), name = max(gaps)
        told['Last gap'] = f'{name}: {moment(begin)} to {moment(end)}'
    zero = sorted(output.zero)
    if fault:
        return Level.ERROR, fault, told
    words = [
        *problems,
        *(
            [
                f'changes of {some(behind)} come up to {max(map(late.__getitem__, behind)):.0f} s '
                'late: their source has fallen behind'
            ]
            if behind
            else []
        ),
        *(
            [f'values of {some(still)} change while their time stands still: ours is taken']
            if still
            else []
        ),
        *([f'nothing yet from {some(missing)}'] if missing else []),
        *([f'bad: {some(bad)}'] if bad else []),
        *(
            [f'p1, p2 and ps of {some(zero)} are exactly 0: leave a field out, do not send 0']
            if zero
            else []
        ),
    ]
    if words:
        return Level.WARN, '; '.join(words), told
    return Level.OK, f'{len(joiners)} valve(s) connected', told
