# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Foxglove's and Lichtblick's own parsers decode every message that we write, as we do."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from damadics_fd.bag import BagWriter, read_columns, write_columns
from damadics_fd.bag.cdr.definition import schema_text
from damadics_fd.bag.mcap.reader import McapFile
from damadics_fd.bag.rosbag2 import qos
from damadics_fd.bag.salvage import salvage
from damadics_fd.commands.replay.replay import main as replay

from .bag_support import FAULT_STATE, MEASUREMENT, needs_messages, simulated, stroke

ROOT = Path(__file__).parents[5]
NPM = ROOT / 'tools' / 'npm'
GOLDEN = sorted((ROOT / 'bags').glob('*.mcap'))
MAKERS = ('foxglove', 'lichtblick')

pytestmark = [
    needs_messages,
    pytest.mark.skipif(not shutil.which('npm'), reason='npm is not installed'),
    pytest.mark.skipif(not NPM.is_dir(), reason='tools/npm is not here: an installed package'),
]


@pytest.fixture(scope='module')
def decoded():
    """Return a function that decodes a file with the parser of a maker."""
    if not (NPM / 'node_modules').is_dir():
        subprocess.run(['npm', 'ci', '--silent', '--prefix', str(NPM)], check=True, timeout=120)

    def run(maker: str, path: Path) -> dict:
        done = subprocess.run(
            ['node', str(NPM / 'read.mjs'), maker, str(path)],
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run


def assert_equal_to_ours(found: dict, path: Path) -> None:
    """Compare every value of every message."""
    with McapFile(path) as mcap:
        counts = {c.topic: mcap.stated[c.id] for c in mcap.channels.values()}
    assert {name: topic['count'] for name, topic in found['topics'].items()} == counts
    assert found['indexed'] == sum(counts.values())
    for name, topic in found['topics'].items():
        if not topic['count']:
            continue
        ours = read_columns(path, name)
        assert [int(stamp) for stamp in topic['log_time']] == ours.pop('log_time').tolist()
        theirs = topic['columns']
        if 'stamp' in ours:
            seconds = np.array(theirs['header.stamp.sec'], np.int64) * 10**9
            stamp = ours.pop('stamp')
            assert (seconds + np.array(theirs['header.stamp.nanosec']) == stamp).all()
        for field, values in ours.items():
            if f'{field}.sec' in theirs:
                seconds = np.array(theirs[f'{field}.sec'], np.int64) * 10**9
                assert (seconds + np.array(theirs[f'{field}.nanosec']) == values).all()
                continue
            rows = np.array(theirs[field], float)  # 'NaN' is a word in JSON
            assert np.array_equal(rows, values.astype(float), equal_nan=True), field


@pytest.mark.parametrize('maker', MAKERS)
@pytest.mark.parametrize('path', GOLDEN, ids=lambda path: path.stem)
def test_golden_bags_are_decoded_with_our_values(path, maker, decoded):
    found = decoded(maker, path)
    assert (found['profile'], found['metadata']) == ('ros2', ['rosbag2'])
    assert found['topics']['/measurement']['type'] == MEASUREMENT
    assert_equal_to_ours(found, path)


def recorded(folder: Path) -> Path:
    """Write message by message, as the recorder does, types within types."""
    path = folder / 'recorded.mcap'
    with BagWriter(path) as bag:
        topic = bag.add_topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', [qos()])
        empty = bag.add_topic('/empty', 'std_msgs/msg/Empty', [qos()])
        array = b'\0\1\0\0' + bytes(8) + b'\2\0\0\0a\0' + bytes(2) + b'\1\0\0\0' + b'\1' + bytes(3)
        array += b'\2\0\0\0n\0' + bytes(2) + b'\1\0\0\0\0' + bytes(3) + b'\1\0\0\0\0' + bytes(3)
        array += bytes(4)
        for i in range(50):
            bag.write(topic, array, i, i)
            bag.write(empty, b'\0\1\0\0\0', i, i)
    return path


def simulated_columns(folder: Path) -> Path:
    write_columns(folder / 'columns.mcap', simulated(3000))
    return folder / 'columns.mcap'


def recovered(folder: Path) -> Path:
    write_columns(folder / 'whole.mcap', simulated(3000))
    (folder / 'cut.mcap').write_bytes((folder / 'whole.mcap').read_bytes()[:-300])
    salvage(folder / 'cut.mcap', folder / 'recovered.mcap')
    return folder / 'recovered.mcap'


def flags(folder: Path) -> Path:
    write_columns(folder / 'valve.mcap', stroke())
    code = replay([str(folder / 'valve.mcap'), '--mode', 'paper', '--bag', str(folder / 'out')])
    assert code == 0
    return next((folder / 'out').glob('*.mcap'))


@pytest.mark.parametrize('maker', MAKERS)
@pytest.mark.parametrize('write', [recorded, simulated_columns, recovered, flags])
def test_bags_of_every_writer_are_decoded_with_our_values(write, maker, tmp_path, decoded):
    path = write(tmp_path)
    assert_equal_to_ours(decoded(maker, path), path)


@pytest.mark.parametrize('kind', [MEASUREMENT, FAULT_STATE, 'diagnostic_msgs/msg/DiagnosticArray'])
def test_dependent_types_are_named_as_rosbag2_names_them(kind):
    named = [line for line in schema_text(kind).splitlines() if line.startswith('MSG:')]
    assert 'MSG: std_msgs/Header' in named
    assert 'MSG: builtin_interfaces/Time' in named
    assert not [line for line in named if '/msg/' in line]
