"""Real recordings with known kinematics: where they are, how they are read and split."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
import tempfile

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.preprocessing import for_training, preprocess
from lip_id_ros.recording import JointSamples, read_sources
from lip_id_ros.recording.reading import read_log
from lip_id_ros.settings import PreprocessingSettings, RecordingSettings

UNSEEN = 0.3
SPLITS = ('last', 'first')
"""Which 30 % of the samples, or of the recordings, are unseen."""

PERTURBATION = 1e-10
"""Of torques, relative."""

UR10_JOINTS = (
    *('shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint'),
    *('wrist_1_joint', 'wrist_2_joint', 'wrist_3_joint'),
)
MED7_RATE_HZ, MED7_SCALE = 100.0, (-1.0,) * 7
"""Its efforts are minus the torques of the joints, as `lip_id inspect --efforts` diagnoses."""

C1_LOGS = 'dfki_double_pendulum/C1_*.csv'

TIAGO_SCALE = (1.0, 13.6, 13.6, -8.7, -8.7)


@dataclass(frozen=True, eq=False)
class RawRecordings:
    """Recordings of one arm before preprocessing, and what their efforts are."""

    samples: list[JointSamples]
    recording: RecordingSettings


@dataclass(frozen=True)
class RealArm:
    """
    A recorded arm: what reads its recordings from the data folder, in the order of time.

    `urdf` has its kinematics, in the data folder, with its names of the joints.

    """

    load: Callable[[Path], RawRecordings]
    urdf: str
    joints: tuple[str, ...]

    def datasets(self, folder: Path) -> list[Dataset]:
        """Return the preprocessed recordings, which are read once."""
        return list(_datasets(self, folder))

    def split(
        self, folder: Path, unseen: str, kernel: str = ARTICULATED
    ) -> tuple[Dataset, Dataset]:
        """
        Return samples for a fit and unseen ones, joints named as in the URDF.

        Kernels other than `articulated` learn from no samples near rest.

        """
        data = self.datasets(folder)
        if len(data) == 1:
            first, last = data[0].split(1.0 - UNSEEN if unseen == 'last' else UNSEEN)
        else:
            rest = round(UNSEEN * len(data))
            cut = len(data) - rest if unseen == 'last' else rest
            first, last = concatenate(data[:cut]), concatenate(data[cut:])
        train, test = (last, first) if unseen == 'first' else (first, last)
        train = for_training(train, PreprocessingSettings(), kernel)
        train, test = (replace(each, joint_names=self.joints) for each in (train, test))
        return train, test


@cache
def _datasets(arm: RealArm, folder: Path) -> tuple[Dataset, ...]:
    raw = arm.load(folder)
    return tuple(preprocess(each, recording=raw.recording) for each in raw.samples)


def _bag(path: str, recording: RecordingSettings | None = None) -> Callable[[Path], RawRecordings]:
    chosen = recording or RecordingSettings()
    return lambda folder: RawRecordings(list(read_sources([folder / path], chosen)), chosen)


def _logs(*paths: str) -> Callable[[Path], RawRecordings]:
    return lambda folder: RawRecordings(
        [read_log(folder / path) for path in paths], RecordingSettings()
    )


def _log(columns: Mapping[str, Array], recording: RecordingSettings) -> RawRecordings:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'log.csv'
        table = np.column_stack(list(columns.values()))
        np.savetxt(path, table, delimiter=',', header=','.join(columns), comments='')
        return RawRecordings([read_log(path)], recording)


def _med7(folder: Path) -> RawRecordings:
    table = np.loadtxt(
        folder / 'kuka_lbr_med7/measurements.csv', delimiter=',', skiprows=1, ndmin=2
    )
    columns = {'t': np.arange(len(table)) / MED7_RATE_HZ}
    columns |= {f'q_{k}': table[:, k] for k in range(7)}
    columns |= {f'tau_{k}': table[:, 7 + k] for k in range(7)}
    return _log(columns, RecordingSettings(effort_scale=MED7_SCALE))


def _tiago(folder: Path) -> RawRecordings:
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


def _go2(folder: Path) -> RawRecordings:
    """Return logs of twelve leg joints, in which stamps are repeated or late."""
    samples = []
    for path in sorted(folder.glob('unitree_go2_csv/*_state_history.csv')):
        table = np.loadtxt(path, delimiter=',', ndmin=2)
        table = table[np.concatenate([[True], np.diff(table[:, 0]) > 0.0])]
        t, (q, dq, tau) = 1e-9 * (table[:, 0] - table[0, 0]), np.split(table[:, 1:], 3, axis=1)
        names = _numbered('leg_joint_{}', 1, q.shape[1])
        samples.append(JointSamples(t, q, dq, tau, names))
    return RawRecordings(samples, RecordingSettings())


ARMS: dict[str, RealArm] = {
    'UR10': RealArm(
        _bag(
            'unisa_ros2_bags/ur10/ur10_exciting_trajectory.db3',
            RecordingSettings(joints=UR10_JOINTS),
        ),
        'urdf/ur10_robot.urdf',
        UR10_JOINTS,
    ),
    'Panda, 30 Hz': RealArm(
        _bag('unisa_ros2_bags/panda/panda_exciting_trajectory.db3'),
        'urdf/panda.urdf',
        _numbered('panda_joint{}', 1, 7),
    ),
    'Panda, 1 kHz': RealArm(
        _logs('panda_gaz2019/exciting.csv'), 'urdf/panda.urdf', _numbered('panda_joint{}', 1, 7)
    ),
    'KUKA LWR': RealArm(
        _logs(*_numbered('kuka_lwr_polydoros/kuka_lwr_{}.csv', 1, 10)),
        'urdf/kuka_lwr4_flobaroid.urdf',
        _numbered('lwr_{}_joint', 0, 7),
    ),
    'Staubli TX40': RealArm(
        _logs('staubli_tx40/exciting.csv'),
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


OTHERS = {
    'UR3': _logs(*(f'ur3_aspectum/{day}.csv' for day in ('day_2104', 'day_2125', 'train_id1'))),
    'double pendulum, identification': lambda folder: _logs(
        *(f'dfki_double_pendulum/{each.name}' for each in sorted(folder.glob(C1_LOGS)))
    )(folder),
    'double pendulum, swung up': _logs(
        *_numbered('dfki_double_pendulum/free_acrobot_0{}.csv', 1, 4)
    ),
    'double pendulum, pushed': _logs(
        *_numbered('dfki_double_pendulum/pert_acrobot_0{}.csv', 1, 4)
    ),
    'TIAGo, controller state': _bag('tiago_ros1_jtc_state/arm_jointstate.bag'),
    'Unitree Go2': _go2,
}
"""Recordings of arms without a URDF or motion to learn from, by what they are called."""


def rounded(dataset: Dataset, seed: int) -> Dataset:
    """Return a data set whose torques differ by rounding alone; for seed 0 the same."""
    noise = np.random.default_rng(seed).standard_normal(dataset.tau.shape)
    return replace(dataset, tau=dataset.tau * (1.0 + (seed > 0) * PERTURBATION * noise))
