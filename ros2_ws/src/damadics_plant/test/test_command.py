# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""The command `simulate`."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.bag.cdr.definition import schema_text
from damadics_fd.bag.columns import read_columns
from damadics_fd.bag.errors import BagError
from damadics_plant import CATALOGUE, export, figures, scenario_names, simulate
from damadics_plant.actuator.parameters import LuGreActuator
from damadics_plant.command import main

HEADER = 't,cv,x1,p1,p2,t1,flow,ps,fault,strength'


def table(path):
    return np.genfromtxt(path, delimiter=',', names=True)


def start(*arguments):
    environment = os.environ | {'PYTHONPATH': os.pathsep.join(sys.path)}
    return subprocess.Popen(
        [sys.executable, '-m', 'damadics_plant.command', *arguments],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_for(condition, what, seconds=120):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, f'no {what} within {seconds} s'
        time.sleep(0.02)


def test_csv_has_the_run_bit_for_bit(tmp_path):
    out = tmp_path / 'a.csv'
    assert main(['paper_spring', '--out', str(out), '--rate', '50', '--noise', '--seed', '3']) == 0
    assert out.read_text().splitlines()[0] == HEADER
    run = simulate('paper_spring', rate=50, noise=True, seed=3)
    rows = table(out)
    for name in HEADER.split(','):
        assert np.array_equal(rows[name], getattr(run, name)), name


def test_scada_view_is_of_the_same_run(tmp_path):
    out, scada = tmp_path / 'a.csv', tmp_path / 's.csv'
    assert main(['random_spring', '--out', str(out), '--scada', str(scada), '--noise']) == 0
    assert np.array_equal(table(out)[::400], table(scada))
    assert len(table(scada)) == 121


def test_mcap_has_the_run_bit_for_bit(tmp_path):
    try:
        schema_text('damadics_msgs/msg/Measurement')
    except BagError as error:
        pytest.skip(str(error))
    out = tmp_path / 'a.mcap'
    assert main(['paper_friction', '--out', str(out)]) == 0
    run = simulate('paper_friction')
    for topic, names in {
        'measurement': ('cv', 'x1', 'p1', 'p2', 't1', 'flow', 'ps'),
        'fault_state': ('fault', 'strength'),
    }.items():
        columns = read_columns(out, topic)
        for name in ('stamp', *names):
            assert np.array_equal(columns[name], run[name]), name


def test_fault_and_inputs_of_ones_own(tmp_path):
    out, again = tmp_path / 'a.csv', tmp_path / 'b.csv'
    assert (
        main(
            [
                '--fault',
                'f19',
                '--strength',
                '-0.4',
                '--from',
                '5',
                '--to',
                '8',
                '--duration',
                '10',
                '--rate',
                '1',
                '--out',
                str(out),
            ]
        )
        == 0
    )
    assert table(out)['strength'].tolist() == 5 * [0] + 3 * [-0.4] + 3 * [0]
    assert (
        main(
            [
                'nominal',
                '--cv',
                f'{out}:x1*0.5',
                '--duration',
                '10',
                '--rate',
                '1',
                '--out',
                str(again),
            ]
        )
        == 0
    )
    assert table(again)['cv'] == pytest.approx(table(out)['x1'] * 0.5)


def test_lists(capsys):
    assert main(['--list', '--faults']) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(scenario_names()) + 19


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        (['zzz', '--out', 'a.csv'], '--list'),
        (['paper_frictoin', '--out', 'a.csv'], 'do you mean paper_friction?'),
        (['nominal', 'f4_I', '--out', 'a.csv'], 'go into a folder'),
        (['nominal', '--out', 'a.txt'], 'FILE.csv nor FILE.mcap'),
        (['nominal', '--out', 'a.csv', '--rate', '300'], '400 Hz'),
        (['nominal', '--out', 'a.csv', '--fault', 'f4', '--strength', '3'], '-1..1'),
        (['nominal', '--out', 'a.csv', '--cv', 'nonsense'], 'FILE:COLUMN'),
        (['nominal', '--out', 'no/folder/a.csv'], 'no/folder/a.csv'),
        (['nominal', 'f1_S', '--out', 'folder', '--scada', 's.csv'], 'single scenario'),
    ],
)
def test_error_is_one_line(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == (1 if 'no/folder/a.csv' in arguments else 2)
    error = capsys.readouterr().err
    assert error.startswith('simulate: ')
    assert message in error
    assert error.count('\n') == 1
    assert not list(tmp_path.glob('*.csv'))


def test_full_disk_is_foreseen(tmp_path, monkeypatch, capsys):
    usage = type('Usage', (), {'free': 10**6})
    monkeypatch.setattr(export.shutil, 'disk_usage', lambda path: usage)
    assert main(['f5_I', '--out', str(tmp_path / 'a.csv')]) == 1
    assert 'lower --rate' in capsys.readouterr().err


def test_many_scenarios_go_to_a_folder(tmp_path):
    assert main(['paper_friction', 'f1_S', '--rate', '1', '--out', str(tmp_path / 'runs')]) == 0
    assert {path.name for path in (tmp_path / 'runs').iterdir()} == {
        'paper_friction.csv',
        'f1_S.csv',
    }
    assert np.array_equal(
        table(tmp_path / 'runs' / 'f1_S.csv')['flow'], simulate('f1_S', rate=1).flow
    )


def test_readme_pictures_are_drawn(tmp_path):
    pytest.importorskip('matplotlib')
    assert figures.main(['--out', str(tmp_path)]) == 0
    for name in ('step_response.png', 'fault_effects.png'):
        assert (tmp_path / name).stat().st_size > 10_000


def test_readme_tables_are_those_of_the_code():
    readme = (Path(__file__).parents[1] / 'README.md').read_text()
    for kind in CATALOGUE.values():
        row = f'| {kind.key} | {kind.name} | {kind.group} | {kind.minimum:g}..1 |'
        assert f'{row} {kind.meaning} | {kind.injection} |' in readme
    for field in fields(LuGreActuator):
        assert f'| `{field.name}` | {field.default:g} |' in readme


@pytest.mark.parametrize('names', [['f5_I'], ['f5_I', 'f6_I', 'f9_I']])
def test_interrupt_leaves_valid_files(tmp_path, names):
    out = tmp_path / 'a.csv' if len(names) == 1 else tmp_path / 'runs'
    process = start(*names, '--out', str(out))
    try:
        wait_for(
            lambda: any(path.stat().st_size > 10**6 for path in tmp_path.rglob('*.csv')), 'output'
        )
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 130
    assert 'valid' in error
    times = [table(path)['t'] for path in tmp_path.rglob('*.csv')]
    assert max(map(len, times)) > 1000
    for t in times:
        assert np.array_equal(t, np.arange(len(t)) / 400)
