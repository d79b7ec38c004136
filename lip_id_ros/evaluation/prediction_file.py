"""Predictions as files: npz for programs, MCAP for plotting tools."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import os
from pathlib import Path

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError
from lip_id_ros.evaluation.estimator import Uncertain
from lip_id_ros.evaluation.outcome import deviation, Outcome
from lip_id_ros.files import write_npz
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording.bag_writer import JointStateTrack, NumberTrack, Track, write_mcap

FORMAT = 'lip_id_ros prediction'
VERSION = 1
MEASURED_TOPIC, PREDICTED_TOPIC, STD_TOPIC = '/measured', '/predicted', '/predicted_std'
TORQUES = ('tau', 'inertial', 'coriolis', 'gravity', 'friction')
ENERGIES = ('kinetic', 'potential')
UNITS = {
    't': 's',
    **dict.fromkeys((*TORQUES, 'tau_std', 'tau_measured'), 'N m or N'),
    **dict.fromkeys((*ENERGIES, 'kinetic_std', 'potential_std'), 'J'),
}


Values = Mapping[str, Array | None]
"""Estimates by the names of docs/interfaces.md; None, or left out, where a model has none."""
Writer = Callable[[str, Dataset, Values], None]


def writer_for(path: str | os.PathLike[str]) -> Writer:
    """
    Choose how a prediction is written by the suffix of its file.

    Raises
    ------
    ConfigError
        If it is neither .npz nor .mcap.

    """
    suffix = Path(path).suffix
    if suffix not in WRITERS:
        raise ConfigError(
            f'{os.fspath(path)} must end in {" or ".join(WRITERS)}, '
            'which chooses the format of the prediction; give it one of these endings.'
        )
    return WRITERS[suffix]


def estimates(estimator: Uncertain, outcome: Outcome, progress: Progress = silent) -> Values:
    """Return torques, their parts, energies and standard deviations of all of these."""
    estimate = outcome.prediction
    std = deviation(estimator, outcome.dataset, progress)
    return {
        **{name: getattr(estimate, name) for name in (*TORQUES, *ENERGIES)},
        **{f'{name}_std': getattr(std, name) for name in ('tau', *ENERGIES)},
    }


def write_prediction_npz(path: str | os.PathLike[str], data: Dataset, found: Values) -> None:
    """
    Write estimates beside what was measured; see docs/interfaces.md.

    Raises
    ------
    OSError
        If the file cannot be written.

    """
    arrays = {'t': data.t, 'segment': data.segment, 'tau_measured': data.tau}
    arrays |= {name: each for name, each in found.items() if each is not None}
    units = {name: unit for name, unit in UNITS.items() if name in arrays}
    names = {'joint_names': np.array(data.joint_names)}
    write_npz(path, arrays | names, {'format': FORMAT, 'version': VERSION, 'units': units})


def write_prediction_mcap(path: str | os.PathLike[str], data: Dataset, found: Values) -> None:
    """
    Write measured and predicted effort, energies and standard deviations as topics.

    Raises
    ------
    OSError
        If the file cannot be written.

    """
    names, t = data.joint_names, data.t - min(0.0, float(data.t.min()))
    tracks: list[Track] = [JointStateTrack(MEASURED_TOPIC, names, t, data.q, data.dq, data.tau)]
    for name, topic in (('tau', PREDICTED_TOPIC), ('tau_std', STD_TOPIC)):
        if (torques := found.get(name)) is not None:
            tracks.append(JointStateTrack(topic, names, t, effort=torques))
    for name in ENERGIES:
        for ending in ('', '_std'):
            if (energy := found.get(f'{name}{ending}')) is not None:
                tracks.append(NumberTrack(f'/{name}_energy{ending}', t, energy))
    write_mcap(path, tracks)


WRITERS: dict[str, Writer] = {'.npz': write_prediction_npz, '.mcap': write_prediction_mcap}
