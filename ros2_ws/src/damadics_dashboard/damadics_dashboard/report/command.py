# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Command `report`: one valve or the fleet over a period, as HTML, PDF and CSV."""

import argparse
import sys
import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from damadics_fd.ros.arguments import command_parser, split_ros_args, state_folder, suggestion
from damadics_fd.store.file_names import file_name

from damadics_dashboard.words.texts import LANGUAGES, Texts, texts, use_causes

if TYPE_CHECKING:
    from damadics_dashboard.report.content import Report

DAY = 86400.0
FORMS = ('html', 'pdf', 'csv')
FLEET = 'FLEET'
EXAMPLE = """examples:
  ros2 run damadics_dashboard report lv101
  ros2 run damadics_dashboard report FLEET --from 2026-11-01 --to 2026-12-01 --out reports
"""


def parser() -> argparse.ArgumentParser:
    """
    Describe the command line.

    :return: its parser.
    """
    p = command_parser('report', 'Report on one valve or on the fleet over a period.', EXAMPLE)
    p.add_argument('what', metavar='VALVE|FLEET', help='name of the valve, or FLEET for all')
    p.add_argument('--from', dest='since', metavar='TIME', help='ISO date or time (30 days ago)')
    p.add_argument('--to', dest='until', metavar='TIME', help='ISO date or time (now)')
    p.add_argument('--out', type=Path, default=Path(), metavar='DIR', help='folder (here)')
    p.add_argument('--as', dest='forms', nargs='+', choices=FORMS, default=FORMS, help='(all)')
    p.add_argument('--language', choices=tuple(LANGUAGES), default='en', help='(en)')
    p.add_argument(
        '--causes',
        type=Path,
        metavar='FILE',
        help='causes.yaml with your own texts and advice, as causes_file of the detectors',
    )
    p.add_argument(
        '--state',
        type=Path,
        metavar='DIR',
        default=state_folder(),
        help='where the page keeps history and trends (%(default)s)',
    )
    return p


def moment(text: str | None, otherwise: float) -> float:
    """
    Read a date or a time.

    :param text: as ISO 8601 writes it, local time where it names no zone.
    :param otherwise: what None stands for [s].
    :return: [s] since 1970.
    :raises ValueError: naming the text.
    """
    if text is None:
        return otherwise
    try:
        return datetime.fromisoformat(text).timestamp()
    except ValueError:
        raise ValueError(f'{text!r} is no date: write 2026-11-25 or 2026-11-25T14:30') from None


def main(args: list[str] | None = None) -> int:
    """
    Write the reports that are asked for.

    :param args: command line, `sys.argv` by default.
    :return: exit code.
    """
    options = parser().parse_args(split_ros_args(args)[0])
    try:
        now = time.time()
        until = moment(options.until, now)
        since = moment(options.since, until - 30.0 * DAY)
        if since >= until:
            raise ValueError('the period ends before it begins: exchange --from and --to')
        written = write(options, since, until)
    except (ValueError, OSError) as problem:
        print(f'report: {problem}', file=sys.stderr)
        return 2
    for path in written:
        print(path)
    return 0


def write(options: argparse.Namespace, since: float, until: float) -> list[Path]:
    """
    Write the files of a report.

    :param options: the command line.
    :param since: begin of the period [s].
    :param until: its end [s].
    :return: their paths.
    :raises ValueError: where nothing is known of the valve.
    :raises OSError: where a file cannot be read or written.
    """
    if not (options.state / 'history.sqlite').is_file():
        raise ValueError(f'there is no history in {options.state}: start the page first')
    # after the check of the arguments, for they take a second
    from damadics_fd.store.intervals import Intervals

    from damadics_dashboard.report import content, forms
    from damadics_dashboard.store.history import History

    use_causes(options.causes)
    t = texts(options.language)
    history = History(options.state / 'history.sqlite')
    intervals = Intervals(options.state / 'trends.sqlite')
    try:
        sources = content.Sources(history, intervals)
        if options.what == FLEET:
            report = content.fleet_report(sources, since, until, t)
        else:
            known = sources.valves()
            valve = options.what
            if valve not in known:  # people may know the tag better
                of_tag = {tag: name for name, tag in history.tags().items()}
                valve = of_tag.get(valve, valve)
            if valve not in known:
                hint = suggestion(options.what, known) or (
                    f'known are {", ".join(known)}'
                    if known
                    else 'of no valve; what happens is kept while the page runs'
                )
                raise ValueError(f'nothing is known of {options.what}: {hint}')
            report = content.valve_report(sources, valve, since, until, t)
    finally:
        history.close()
        intervals.close()
    options.out.mkdir(parents=True, exist_ok=True)
    written = []
    for form in options.forms:
        path = options.out / f'report_{file_name(options.what)}.{form}'
        if form == 'pdf':
            path.write_bytes(_pdf(report, t))
        elif form == 'html':
            path.write_text(forms.html(report, t), 'utf-8')
        else:
            path.write_text(forms.text_csv(report), 'utf-8-sig')
        written.append(path)
        if form == 'csv' and report.trends:
            path = path.with_name(f'{path.stem}_trends.csv')
            path.write_text(forms.trends_csv(report), 'utf-8-sig')
            written.append(path)
    return written


def _pdf(report: 'Report', t: Texts) -> bytes:
    """Return the PDF, or say what it needs."""
    try:
        from damadics_dashboard.report.paper import pdf
    except ImportError as problem:
        raise ValueError(f'PDF needs fpdf2 ({problem}): pip install fpdf2, or --as html') from None
    return pdf(report, t)


if __name__ == '__main__':
    sys.exit(main())
