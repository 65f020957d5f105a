# Copyright 2026 DAMADICS FD maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write what estimator and detector say as a bag."""

from pathlib import Path

import numpy as np

from damadics_fd.bag.arrays import Column
from damadics_fd.bag.columns import iter_columns
from damadics_fd.bag.errors import BagError
from damadics_fd.bag.recording import Recording
from damadics_fd.bag.rosbag2 import qos
from damadics_fd.bag.writing.bag_writer import NANO, BagWriter
from damadics_fd.core.result import Result

NUMBER = 'damadics_msgs/msg/Float64Stamped'
ESTIMATE = 'damadics_msgs/msg/Estimate'
FLAG = 'damadics_msgs/msg/FaultFlag'
SCALARS = (
    'x2',
    'x1_hat',
    'x2_hat',
    'xi1',
    'xi2',
    'phi',
    'x1',
    'u',
    'ps',
    'dp',
    'progress',
    'phase',
)


class FlagWriter:
    """
    Write estimate, residual, threshold and fault flag of a recording, stamped like its samples.

    :param path: file to write.
    :param recording: what is replayed; its `frame_id` and namespace are taken over.
    """

    def __init__(self, path: Path, recording: Recording):
        prefix = '/' if recording.table else recording.place
        self._names = {
            name: prefix + name for name in ('estimate', 'residual', 'threshold', 'fault_flag')
        }
        self._frame_id = frame_id(recording)
        path.unlink(missing_ok=True)  # what an earlier replay wrote is no recording
        self._bag = BagWriter(path)
        kinds = {'estimate': ESTIMATE, 'residual': NUMBER, 'threshold': NUMBER, 'fault_flag': FLAG}
        for name, kind in kinds.items():
            offered = qos(durability='transient_local', depth=1) if kind == FLAG else qos()
            self._bag.add_topic(self._names[name], kind, [offered])
        self._last_flag: tuple[bool, int, int, int] | None = None  # fault, state, level, second

    def write(self, result: Result) -> None:
        """Write the next rows."""
        rows = result.accepted
        estimates, decisions = result.estimates[rows], result.decisions[rows]
        if not len(estimates):
            return
        stamp = estimates['stamp']
        alphas = np.stack([estimates[name] for name in ('alpha1', 'alpha4', 'alpha5')], axis=1)
        columns = {name: estimates[name] for name in SCALARS} | {'alpha_hat': alphas}
        self._bag.write_columns(
            stamp,
            {
                self._names['estimate']: columns,
                self._names['residual']: {'data': decisions['residual']},
                self._names['threshold']: {'data': decisions['threshold']},
            },
            self._frame_id,
        )
        self._write_flags(decisions)

    def _write_flags(self, decisions: Column) -> None:
        """Write the flag on every change and once a second."""
        keys = np.stack(
            [
                decisions['fault'].astype(np.int64),
                decisions['state'],
                decisions['level'],
                decisions['stamp'] // NANO,
            ],
            axis=1,
        )
        before = np.roll(keys, 1, axis=0)
        before[0] = self._last_flag if self._last_flag is not None else -1
        self._last_flag = tuple(keys[-1].tolist())
        flags = decisions[(keys != before).any(axis=1)]
        if not len(flags):
            return
        columns = {
            name: flags[name]
            for name in ('fault', 'state', 'level', 'residual', 'threshold', 'occurrence')
        }
        for name in ('since', 'onset'):
            columns |= {f'{name}.sec': flags[name] // NANO, f'{name}.nanosec': flags[name] % NANO}
        self._bag.write_columns(
            flags['stamp'], {self._names['fault_flag']: columns}, self._frame_id
        )

    def close(self) -> None:
        """Finish the bag."""
        self._bag.close()


def frame_id(recording: Recording) -> str:
    """
    Return the tag of the actuator, as its first message has it.

    :param recording: the recording.
    :return: `frame_id`, or the name in a table; '' where there is none.
    """
    if recording.table or recording.maps:
        return recording.table.name if recording.table else ''
    if recording.valve:
        return recording.tag
    try:
        chunk = next(
            iter_columns(
                recording.path, recording.topic, ['frame_id'], on_problem=lambda text: None
            )
        )
    except BagError:
        return ''  # a message without header; the reader has its say when it is replayed
    return str(chunk['frame_id'][0]) if len(chunk['frame_id']) else ''
