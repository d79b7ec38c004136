"""Joint samples from CSV logs: t, q_NAME, tau_NAME and, where known, dq_NAME."""

from __future__ import annotations

from collections.abc import Sequence
import os

import numpy as np

from lip_id_ros.dataset.csv_file import check_columns, joints_of, per_joint
from lip_id_ros.dataset.csv_table import PathLike, read_table
from lip_id_ros.errors import SourceError
from lip_id_ros.recording.buffer import SampleBuffer
from lip_id_ros.recording.joint_samples import JointSamples


def read_log(path: PathLike, joints: Sequence[str] = ()) -> JointSamples:
    """
    Read the joint samples of a CSV log; rows that cannot be used are dropped and counted.

    Parameters
    ----------
    path : path
        Columns t [s], q_NAME, tau_NAME and optionally dq_NAME of every joint NAME.
    joints : sequence of str
        Joints to keep; empty for all, in the order of their positions.

    Raises
    ------
    OSError
        If the file cannot be opened.
    DataError
        If it is no table of numbers, or lacks a column.
    SourceError
        If no row can be used.

    """
    table = read_table(path)
    names = tuple(joints) or joints_of(list(table))
    check_columns(path, table, ['t', *(f'{signal}_{name}' for signal in 'q' for name in names)])
    empty = np.empty((table['t'].size, 0))
    position, velocity, effort = (
        per_joint(table, signal, names)
        if all(f'{signal}_{name}' in table for name in names)
        else empty
        for signal in ('q', 'dq', 'tau')
    )
    buffer = SampleBuffer(names, expected_rows=table['t'].size)
    for row, stamp in enumerate(table['t'].tolist()):
        buffer.add(stamp, names, position[row], velocity[row], effort[row])
    samples = buffer.samples(source=os.fspath(path), topic='')
    if samples.n_samples == 0:
        reasons = ', '.join(f'{reason}: {count}' for reason, count in samples.counts.items())
        raise SourceError(f'no row of {os.fspath(path)} can be used ({reasons}); correct the log.')
    return samples
