"""Real recordings with known kinematics: where they are, how they are read and split."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
import tempfile

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.preprocessing import load_dataset
from lip_id_ros.settings import Config, RecordingSettings

UNSEEN = 0.3
SPLITS = ('last', 'first')
"""Which 30 % of the samples, or of the recordings, are unseen."""

UR10_JOINTS = (
    *('shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint'),
    *('wrist_1_joint', 'wrist_2_joint', 'wrist_3_joint'),
)
MED7_RATE_HZ = 100.0
TIAGO_SCALE = (1.0, 13.6, 13.6, -8.7, -8.7)


@dataclass(frozen=True)
class RealArm:
    """
    A recorded arm.

    Attributes
    ----------
    load : callable
        Reads its recordings from the data folder, in the order of time.
    urdf : str
        Kinematics, in the data folder.
    joints : tuple of str
        What the URDF calls the joints.

    """

    load: Callable[[Path], list[Dataset]]
    urdf: str
    joints: tuple[str, ...]

    def split(self, folder: Path, unseen: str) -> tuple[Dataset, Dataset]:
        """Return what to learn from and what is unseen, joints named as in the URDF."""
        recordings = self.load(folder)
        if len(recordings) == 1:
            first, last = recordings[0].split(1.0 - UNSEEN if unseen == 'last' else UNSEEN)
        else:
            count = round(UNSEEN * len(recordings))
            cut = len(recordings) - count if unseen == 'last' else count
            first, last = concatenate(recordings[:cut]), concatenate(recordings[cut:])
        train, test = (first, last) if unseen == 'last' else (last, first)
        return self._named(train), self._named(test)

    def _named(self, dataset: Dataset) -> Dataset:
        return replace(dataset, joint_names=self.joints)


def _file(
    path: str, recording: RecordingSettings | None = None
) -> Callable[[Path], list[Dataset]]:
    config = Config(recording=recording or RecordingSettings())
    return lambda folder: [load_dataset(folder / path, config)]


def _lwr(folder: Path) -> list[Dataset]:
    names = [f'kuka_lwr_polydoros/kuka_lwr_{k}.csv' for k in range(1, 11)]
    return [load_dataset(folder / name) for name in names]


def _log(columns: Mapping[str, Array], recording: RecordingSettings) -> list[Dataset]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'log.csv'
        table = np.column_stack(list(columns.values()))
        np.savetxt(path, table, delimiter=',', header=','.join(columns), comments='')
        return [load_dataset(path, Config(recording=recording))]


def _med7(folder: Path) -> list[Dataset]:
    table = np.loadtxt(
        folder / 'kuka_lbr_med7/measurements.csv', delimiter=',', skiprows=1, ndmin=2
    )
    columns = {'t': np.arange(len(table)) / MED7_RATE_HZ}
    columns |= {f'q_{k}': table[:, k] for k in range(7)}
    columns |= {f'tau_{k}': table[:, 7 + k] for k in range(7)}
    return _log(columns, RecordingSettings())


def _tiago(folder: Path) -> list[Dataset]:
    columns: dict[str, Array] = {}
    for signal, name in (('q', 'position'), ('dq', 'velocity'), ('tau', 'effort')):
        path = folder / f'tiago_figaroh/tiago_{name}.csv'
        table = np.loadtxt(path, delimiter=',', skiprows=1, ndmin=2)
        columns['t'] = table[:, 0]
        columns |= {f'{signal}_{k}': table[:, 1 + k] for k in range(len(TIAGO_SCALE))}
    types = ('prismatic', *('revolute',) * (len(TIAGO_SCALE) - 1))
    return _log(columns, RecordingSettings(joint_types=types, effort_scale=TIAGO_SCALE))


def _numbered(pattern: str, first: int, count: int) -> tuple[str, ...]:
    return tuple(pattern.format(k) for k in range(first, first + count))


ARMS: dict[str, RealArm] = {
    'UR10': RealArm(
        _file(
            'unisa_ros2_bags/ur10/ur10_exciting_trajectory.db3',
            RecordingSettings(joints=UR10_JOINTS),
        ),
        'urdf/ur10_robot.urdf',
        UR10_JOINTS,
    ),
    'Panda, 30 Hz': RealArm(
        _file('unisa_ros2_bags/panda/panda_exciting_trajectory.db3'),
        'urdf/panda.urdf',
        _numbered('panda_joint{}', 1, 7),
    ),
    'Panda, 1 kHz': RealArm(
        _file('panda_gaz2019/exciting.csv'), 'urdf/panda.urdf', _numbered('panda_joint{}', 1, 7)
    ),
    'KUKA LWR': RealArm(_lwr, 'urdf/kuka_lwr4_flobaroid.urdf', _numbered('lwr_{}_joint', 0, 7)),
    'Staubli TX40': RealArm(
        _file('staubli_tx40/exciting.csv'),
        'staubli_tx40/tx40_mdh_modified.urdf',
        _numbered('joint_{}', 1, 6),
    ),
    'TIAGo': RealArm(
        _tiago,
        'tiago_figaroh/tiago_no_hand.urdf',
        ('torso_lift_joint', *_numbered('arm_{}_joint', 1, 4)),
    ),
    'KUKA Med 7': RealArm(_med7, 'kuka_lbr_med7/med7dock.urdf', _numbered('A{}', 1, 7)),
}
"""By the names that the documents have for them."""
