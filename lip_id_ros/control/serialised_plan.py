"""
Read a serialised JointTrajectory as arrays.

A message of 50,000 points takes a second as objects, and the commands would stop meanwhile. All
points of a plan have arrays of one length, so its bytes are one table.
"""

from __future__ import annotations

import numpy as np

from lip_id_ros.control.plan import PlanArrays
from lip_id_ros.signals.joints import JointOrder, Refusal, RefusedError
from lip_id_ros.signals.trajectory_header import ENCAPSULATION, read_header, TrajectoryHeader

WORD, DOUBLE = 4, 8


def read_serialised(raw: bytes, order: JointOrder, most_points: int) -> PlanArrays:
    """
    Return the points of a plan in an order of joints.

    `raw`: the message, in CDR of either byte order. `most_points`: of a plan that is read.
    RefusedError if it ends before, has no or too many points, or joints or lengths do not fit.
    """
    header = read_header(raw)
    columns = order.columns(header.names)
    if header.n_points == 0:
        raise RefusedError(Refusal.NO_POINTS)
    if header.n_points > most_points:
        raise RefusedError(Refusal.TOO_LONG)
    table = _table(raw, header)
    kinds = ('positions', 'velocities', 'accelerations')
    states = np.stack([table[kind].astype(np.float64) for kind in kinds])
    if not np.isfinite(states).all():  # of joints that are not controlled too
        raise RefusedError(Refusal.NOT_FINITE)
    effort = np.zeros((len(table), len(columns)))
    if 'effort' in (table.dtype.names or ()):
        effort = table['effort'].astype(np.float64).take(columns, axis=1)
    t = table['sec'] + 1e-9 * table['nanosec']
    return PlanArrays(t, states.take(columns, axis=2), effort)


def _table(raw: bytes, header: TrajectoryHeader) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Return one row a point; RefusedError unless all arrays are as long as the joint names."""
    n = len(header.names)
    body = raw[ENCAPSULATION:] + bytes(DOUBLE)  # a row ends with the padded count of the next
    first = -(-(header.at + WORD) // DOUBLE) * DOUBLE  # the first position
    array = DOUBLE * n + DOUBLE  # with the count behind it, padded
    word = np.dtype(f'{header.order}u4')

    def counts(at: int, dtype: np.dtype[np.void] | np.dtype[np.uint32]) -> object:
        if at + dtype.itemsize > len(body):
            raise RefusedError(Refusal.WRONG_LENGTH)
        return np.frombuffer(body, dtype, 1, at)[0]

    has_effort = counts(first + 3 * array - DOUBLE, word) != 0
    row = _row(header.order, n, array, has_effort)
    next_count = DOUBLE if has_effort else WORD
    end = first + header.n_points * row.itemsize - next_count
    if end > len(body) - DOUBLE or counts(header.at, word) != n:
        raise RefusedError(Refusal.WRONG_LENGTH)
    table = np.frombuffer(body, row, header.n_points, first)
    lengths = [table['n_velocities'], table['n_accelerations'], table['n_positions'][:-1]]
    if any((each != n).any() for each in lengths) or (table['n_effort'] != has_effort * n).any():
        raise RefusedError(Refusal.WRONG_LENGTH)
    return table


def _row(order: str, n: int, array: int, has_effort: bool) -> np.dtype[np.void]:
    """Return the layout of a point from its first position on, and the count of the next."""
    numbers, word = (f'{order}f8', (n,)), f'{order}u4'
    time = 4 * array - DOUBLE if has_effort else 3 * array - WORD
    fields = {
        'positions': (numbers, 0),
        'n_velocities': (word, array - DOUBLE),
        'velocities': (numbers, array),
        'n_accelerations': (word, 2 * array - DOUBLE),
        'accelerations': (numbers, 2 * array),
        'n_effort': (word, 3 * array - DOUBLE),
        'sec': (f'{order}i4', time),
        'nanosec': (word, time + WORD),
        'n_positions': (word, time + 2 * WORD),
    }
    if has_effort:
        fields['effort'] = (numbers, 3 * array)
    return np.dtype(
        {
            'names': list(fields),
            'formats': [kind for kind, _ in fields.values()],
            'offsets': [at for _, at in fields.values()],
            'itemsize': (4 if has_effort else 3) * array + DOUBLE,
        }
    )
