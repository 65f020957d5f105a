# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command commission: what a valve is, from fault-free recordings of it."""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from damadics_fd.bag.errors import BagError
from damadics_fd.bag.recording import find_recordings, parse_maps
from damadics_fd.commands.commission.control_room import identify as identify_scada
from damadics_fd.commands.commission.errors import CommissioningError
from damadics_fd.commands.commission.monitor import identify
from damadics_fd.commands.commission.plot import draw
from damadics_fd.commands.commission.twin.constants import model, write_twin
from damadics_fd.commands.commission.valve_file import parameter_file
from damadics_fd.commands.many_valves import (
    by_valve,
    commission_all,
    need_a_folder,
    read_all,
    warn,
)
from damadics_fd.commands.options import add_settings, add_sources, settings_in
from damadics_fd.commands.stages import Stages
from damadics_fd.core.settings import Settings, SettingsError
from damadics_fd.core.settings.identified import REFUSED, FaultFree, Identified
from damadics_fd.ros.arguments import command_parser
from damadics_fd.store.references import Reference, save_reference

EXAMPLES = """examples:
  ros2 run damadics_fd commission bags/fault_free --actuator LV-101 --out lv101.yaml
  ros2 run damadics_fd commission monday.csv tuesday.csv --map x1=POS*0.01 --set mass=3.5 \\
      --set area=0.045 --days 90 --reference references/LV-101 --actuator LV-101 --out lv101.yaml
  ros2 run damadics_fd commission before_the_fault.mcap --until 70 --out lv101.yaml
  ros2 run damadics_fd commission day1.csv day2.csv --mode scada --out lv101.yaml
  ros2 run damadics_fd commission plant_bags/ --out valves --reference references   many valves"""
FAILED, NOT_USABLE = 1, 3
FAILED_VERDICT = 'failed'


def arguments(args: list[str] | None = None) -> argparse.Namespace:
    """
    Parse the command line.

    :param args: words; those of the process where absent.
    :return: the options.
    """
    parser = command_parser(
        'commission',
        'Identify a valve from fault-free recordings in which it moves both ways for '
        'some minutes: write its parameter file, and say what will be found with it. Exit code '
        '0: ok or limited, 1: the recordings cannot be used, 3: refused.',
        EXAMPLES,
    )
    parser.add_argument(
        'recordings', nargs='+', type=Path, metavar='RECORDING', help='MCAP, bag folder or table'
    )
    parser.add_argument('--mode', choices=('monitor', 'scada'), default='monitor')
    parser.add_argument(
        '--out',
        type=Path,
        metavar='FILE',
        help='write the parameter file (YAML); of many valves: a folder, for these and fleet.yaml',
    )
    parser.add_argument('--plot', type=Path, metavar='FILE', help='draw the sanity plot (PNG)')
    parser.add_argument(
        '--until',
        type=float,
        metavar='S',
        help='use the recordings up to that time only, counted from their beginning',
    )
    parser.add_argument(
        '--reference',
        type=Path,
        metavar='PATH',
        help='write what was learned as the reference, PATH.a.json or .b.json; of many valves: '
        'a folder',
    )
    parser.add_argument('--actuator', default='', help='tag of the actuator, kept in the files')
    parser.add_argument(
        '--twin',
        type=Path,
        metavar='FILE',
        help='write a model of this valve for plant and simulate --valve FILE',
    )
    parser.add_argument(
        '--days',
        type=float,
        default=30.0,
        help='at most one false alarm in so many days (default 30)',
    )
    add_settings(parser, 'a setting from the data sheet: mass, stroke, area, plug_diameter ..')
    add_sources(parser)
    options = parser.parse_args(args)
    if not options.days > 0.0:
        parser.error('--days must be positive')
    if options.until is not None and not options.until > 0.0:
        parser.error('--until must be positive')
    folder = options.out is not None and not options.out.suffix
    if options.reference and not options.actuator and not folder:
        parser.error('--reference belongs to an actuator: name it with --actuator')
    if options.mode == 'scada' and (options.plot or options.twin):
        parser.error('--plot and --twin are of mode monitor')
    return options


def until(recordings: list[FaultFree], seconds: float | None) -> list[FaultFree]:
    """
    Return the beginnings of recordings.

    :param recordings: whole.
    :param seconds: [s] from the beginning of each, after which nothing is used; None for all.
    :return: what is to be used.
    """
    if seconds is None:
        return recordings
    found = []
    for one in recordings:
        stamp = np.asarray(one.columns['stamp'], np.int64)
        kept = stamp - stamp[0] <= seconds * 1e9
        columns = {name: column[kept] for name, column in one.columns.items()}
        found.append(FaultFree(one.name, columns))
    return found


def data_sheet(texts: list[str], mode: str = 'monitor') -> tuple[Settings, set[str]]:
    """
    Return settings with the values of the command line.

    :param texts: NAME=VALUE.
    :param mode: monitor or scada.
    :return: the settings, and the names that were given.
    :raises SettingsError: listing every mistake.
    """
    values = settings_in(texts)
    return Settings.for_mode(mode, **values), set(values)


def main(args: list[str] | None = None) -> int:
    """
    Run the command.

    :param args: words; those of the process where absent.
    :return: exit code.
    """
    options = arguments(args)
    with Stages('commission') as stages:
        return _run(options, stages)


def _run(options: argparse.Namespace, stages: Stages) -> int:
    """Do what the command line says; return the exit code."""

    def told(text: str) -> None:
        stages.hide()
        warn(text)
        stages.tell('reading the recordings')

    try:
        stages.tell('looking at the recordings')
        sheet, given = data_sheet(options.set, options.mode)
        found = find_recordings(
            options.recordings, topic=options.topic, maps=parse_maps(options.map)
        )
        groups = by_valve(found, options.actuator)
        source = ', '.join(str(path) for path in options.recordings)
        if len(groups) > 1:
            need_a_folder(groups, options)

            def one_of_many(
                name: str, tag: str, recordings: list[FaultFree], file: Path
            ) -> Identified:
                reference = options.reference / file.stem if options.reference else None
                stages.tell(f'{name}: identifying the valve')
                return _commission(
                    recordings, sheet, given, options, source, tag, file, reference, stages
                )

            stages.tell(f'reading the recordings of {len(groups)} valves')
            return _code(commission_all(groups, options, one_of_many, told))
        if options.reference and not options.actuator:
            raise CommissioningError('--reference belongs to an actuator: name it with --actuator')
        stages.tell('reading the recordings')
        (recordings,) = read_all(groups, told).values()
        if not recordings:
            raise CommissioningError(f'{source} holds no measurement')
        stages.tell('identifying the valve')
        identified = _commission(
            recordings, sheet, given, options, source, options.actuator, options.out,
            options.reference, stages,
        )  # fmt: skip
        for line in identified.report:
            print(line)
        if options.out:
            print(f'written: {options.out}')
        if options.twin:
            print(f'twin: {options.twin}')
    except (BagError, CommissioningError, SettingsError, KeyError, OSError, ValueError) as error:
        stages.hide()
        print(f'commission: {error}', file=sys.stderr)
        return FAILED
    return _code([identified.verdict])


def _code(verdicts: Sequence[str]) -> int:
    """Return the exit code: that of the worst valve."""
    if FAILED_VERDICT in verdicts:
        return FAILED
    return NOT_USABLE if REFUSED in verdicts else 0


def _commission(
    recordings: list[FaultFree],
    sheet: Settings,
    given: set[str],
    options: argparse.Namespace,
    source: str,
    tag: str,
    out: Path | None,
    reference: Path | None,
    stages: Stages,
) -> Identified:
    """Identify one valve, and write its files."""
    recordings = until(recordings, options.until)
    try:
        identified = _identify(recordings, sheet, given, options, tag)
    finally:
        stages.hide()
    if out:
        text = parameter_file(identified, options.mode, source, tag, str(reference or ''))
        out.write_text(text, encoding='utf-8')
    if reference and identified.verdict != REFUSED:
        _write_reference(identified, recordings, options.mode, tag, reference, source)
    return identified


def _identify(
    recordings: list[FaultFree],
    sheet: Settings,
    given: set[str],
    options: argparse.Namespace,
    tag: str,
) -> Identified:
    if options.mode == 'scada':
        return identify_scada(recordings, sheet, given)
    proposal = identify(recordings, sheet, given, options.days)
    if options.plot:
        draw(proposal, options.plot)
    if options.twin:
        write_twin(proposal, options.twin, tag)
    found = proposal.identified(Settings.for_mode('monitor'))
    try:
        return replace(found, twin=model(proposal, tag))
    except CommissioningError as error:  # the simulated actuator cannot be every valve
        return replace(found, report=(*found.report, f'note: {error}'))


def _write_reference(
    identified: Identified,
    recordings: list[FaultFree],
    mode: str,
    tag: str,
    reference: Path,
    source: str,
) -> None:
    if not identified.learned:
        print('commission: nothing was learned: no reference is written', file=sys.stderr)
        return
    settings = Settings.from_mapping({'mode': mode, **identified.settings})
    written = save_reference(
        reference,
        Reference(
            tag,
            dict(identified.learned),
            settings.to_dict(),
            source=source,
            first_stamp=int(recordings[0].columns['stamp'][0]),
            last_stamp=int(recordings[-1].columns['stamp'][-1]),
            commissioning=identified.judgement(),
        ),
    )
    print(f'reference of {tag}: {written}')


if __name__ == '__main__':
    sys.exit(main())
