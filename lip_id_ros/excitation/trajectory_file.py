"""Motions as files: a JointTrajectory in YAML or in a bag, and a CSV table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import json
import os
from pathlib import Path
from typing import NamedTuple

from lip_id_ros.arrays import Array
from lip_id_ros.csv_table import quoted
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.series import FourierMotion
from lip_id_ros.files import write_whole
from lip_id_ros.recording.bag_writer import JointTrajectoryTrack, write_mcap

TOPIC = '/joint_trajectory'
FIRST_LINE = '# trajectory_msgs/msg/JointTrajectory of lip_id excite'
FIRST_COLUMNS = 't,q_', 't,"q_'
SUMMARY_BYTES = 20_000
"""At the end of an MCAP file, with its topics and types in plain bytes."""
SIGNALS = ('q', 'dq', 'ddq')


class Trajectory(NamedTuple):
    """Joint states (N, n) at times (N,) from the start [s]."""

    joint_names: tuple[str, ...]
    t: Array
    q: Array
    dq: Array
    ddq: Array

    def in_order(self, joint_names: Sequence[str]) -> Trajectory:
        """Return the same motion with its joints in another order."""
        columns = [self.joint_names.index(name) for name in joint_names]
        states = (each[:, columns] for each in (self.q, self.dq, self.ddq))
        return Trajectory(tuple(joint_names), self.t, *states)


def sampled(motion: FourierMotion, joint_names: Sequence[str], rate: float) -> Trajectory:
    """Return the states of a motion at a rate [Hz], from its start to its end."""
    t = motion.times(rate)
    return Trajectory(tuple(joint_names), t, *motion.sample(t))


def writer_for(path: str) -> Callable[[str, Trajectory], None]:
    """Return what writes the format of a suffix; ConfigError if there is none."""
    suffix = Path(path).suffix.lower()
    if suffix not in WRITERS:
        raise ConfigError(
            f'a motion is written as {", ".join(WRITERS)}, but {path} ends otherwise; '
            'name another output.'
        )
    return WRITERS[suffix]


def is_motion(path: Path) -> bool:
    """Whether a file is a motion that this module wrote."""
    with open(path, 'rb') as file:
        head = file.read(100)
        if head.startswith(b'\x89MCAP'):
            file.seek(-min(SUMMARY_BYTES, path.stat().st_size), os.SEEK_END)
            end = file.read()
            return TOPIC.encode() in end and b'sensor_msgs' not in end
    return head.startswith(tuple(each.encode() for each in (FIRST_LINE, *FIRST_COLUMNS)))


def write_yaml(path: str, trajectory: Trajectory) -> None:
    """Write a message as `ros2 topic pub` and `ros2 action send_goal` take it."""
    write_whole(path, to_yaml(trajectory).encode())


def to_yaml(trajectory: Trajectory) -> str:
    """Return the message in YAML."""
    lines = [FIRST_LINE, 'header: {stamp: {sec: 0, nanosec: 0}, frame_id: ""}']
    lines += [f'joint_names: {json.dumps(trajectory.joint_names, ensure_ascii=False)}', 'points:']
    for t, q, dq, ddq in zip(*trajectory[1:], strict=True):
        seconds, nanoseconds = divmod(round(1e9 * t), 10**9)
        lines += [
            f'- positions: {_numbers(q)}',
            f'  velocities: {_numbers(dq)}',
            f'  accelerations: {_numbers(ddq)}',
            f'  time_from_start: {{sec: {seconds}, nanosec: {nanoseconds}}}',
        ]
    return '\n'.join(lines) + '\n'


def _numbers(row: Array) -> str:
    return f'[{", ".join(repr(x) for x in row.tolist())}]'


def write_csv(path: str, trajectory: Trajectory) -> None:
    """Write columns t, q_NAME, dq_NAME, ddq_NAME."""
    names = [f'{signal}_{joint}' for signal in SIGNALS for joint in trajectory.joint_names]
    lines = [','.join(quoted(name) for name in ['t', *names])]
    for t, *states in zip(*trajectory[1:], strict=True):
        numbers = [t.item(), *(x for state in states for x in state.tolist())]
        lines.append(','.join(map(repr, numbers)))
    write_whole(path, ('\n'.join(lines) + '\n').encode())


def write_bag(path: str, trajectory: Trajectory) -> None:
    """Write a bag with one message, a JointTrajectory."""
    write_mcap(path, [JointTrajectoryTrack(TOPIC, *trajectory)])


WRITERS = {'.yaml': write_yaml, '.csv': write_csv, '.mcap': write_bag}
