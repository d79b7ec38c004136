"""Joint samples from CSV logs: t, q_NAME, tau_NAME and, where known, dq_NAME."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import os
from typing import Any

import numpy as np

from lip_id_ros.csv_table import check_columns, joints_of, PathLike, read_table
from lip_id_ros.errors import SourceError
from lip_id_ros.recording.joint_samples import gathered, JointSamples, MOST_JOINTS, Reason, SIGNALS
from lip_id_ros.recording.sample_collector import usable
from lip_id_ros.recording.timing import arrange, SECOND, seconds

_LATEST_S = 4e9
_COLUMNS = ('q', 'dq', 'tau')


def read_log(path: PathLike, joints: Sequence[str] = ()) -> JointSamples:
    """
    Read the joint samples of a CSV log; rows that cannot be used are dropped and counted.

    Times may be negative. As in bags, rows are put in the order of time, and single times far
    from those around them are dropped (see `timing.arrange`).

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
        If no row can be used, or there are too many joints.

    """
    table = read_table(path)
    names = tuple(joints) or joints_of(list(table.columns))
    if len(names) > MOST_JOINTS:
        raise SourceError(
            f'{os.fspath(path)} must have at most {MOST_JOINTS} joints, not {len(names)}; choose '
            'some with recording.joints.'
        )
    check_columns(path, table, ['t', *(f'q_{name}' for name in names)])
    values = {
        name: table.per_joint(signal, names)
        for name, signal in zip(SIGNALS, _COLUMNS, strict=True)
        if all(f'{signal}_{joint}' in table.columns for joint in names)
    }
    counts: Counter[str] = Counter()
    keep = usable(list(values.values()), counts)
    t = table.columns['t']
    known = np.abs(t) <= _LATEST_S  # not where t is nan
    counts[Reason.BAD_STAMP] += int((keep & ~known).sum())
    kept = np.flatnonzero(keep & known)
    timeline = arrange(np.round(t[kept] * SECOND).astype(np.int64), is_epoch=False)
    counts.update(timeline.dropped)
    if not timeline.rows.size:
        reasons = ', '.join(f'{reason}: {count}' for reason, count in counts.items() if count)
        raise SourceError(f'no row of {os.fspath(path)} can be used ({reasons}); correct the log.')
    rows = kept[timeline.rows]
    nothing = np.full((rows.size, len(names)), np.nan)
    signals: dict[str, Any] = {
        name: gathered(values[name], rows) if name in values else nothing for name in SIGNALS
    }
    return JointSamples(
        t=seconds(timeline.t_ns),
        **signals,
        joint_names=names,
        start_s=timeline.start_ns / SECOND,
        counts={str(reason): count for reason, count in counts.items() if count},
        source=os.fspath(path),
        seen_joints=names,
        notes=(*table.notes, *timeline.notes()),
    )
