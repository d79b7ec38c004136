"""Predictions as files: npz for programs, MCAP for plotting tools."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path

import numpy as np

from lip_id_ros.errors import ConfigError
from lip_id_ros.evaluation.estimator import Uncertain
from lip_id_ros.evaluation.mcap_writer import JointStateTrack, NumberTrack, Track, write_mcap
from lip_id_ros.evaluation.outcome import deviation, Outcome
from lip_id_ros.files import write_npz
from lip_id_ros.progress import Progress, silent

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


Writer = Callable[[str, Uncertain, Outcome, Progress], None]


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


def write_prediction_npz(
    path: str | os.PathLike[str],
    estimator: Uncertain,
    outcome: Outcome,
    progress: Progress = silent,
) -> None:
    """
    Write torques, their parts, energies and standard deviations; see docs/interfaces.md.

    Raises
    ------
    OSError
        If the file cannot be written.

    """
    data, estimate = outcome.dataset, outcome.prediction
    arrays = {'t': data.t, 'segment': data.segment, 'tau_measured': data.tau}
    arrays |= {name: getattr(estimate, name) for name in (*TORQUES, *ENERGIES)}
    std = deviation(estimator, data, progress)
    arrays |= {f'{name}_std': getattr(std, name) for name in ('tau', *ENERGIES)}
    arrays['joint_names'] = np.array(data.joint_names)
    known = {name: values for name, values in arrays.items() if values is not None}
    write_npz(path, known, {'format': FORMAT, 'version': VERSION, 'units': UNITS})


def write_prediction_mcap(
    path: str | os.PathLike[str],
    estimator: Uncertain,
    outcome: Outcome,
    progress: Progress = silent,
) -> None:
    """
    Write measured and predicted effort, energies and standard deviations as topics.

    Raises
    ------
    OSError
        If the file cannot be written.

    """
    data, estimate = outcome.dataset, outcome.prediction
    std = deviation(estimator, data, progress)
    names, t = data.joint_names, data.t - min(0.0, float(data.t.min()))
    tracks: list[Track] = [
        JointStateTrack(MEASURED_TOPIC, names, t, data.q, data.dq, data.tau),
        JointStateTrack(PREDICTED_TOPIC, names, t, effort=estimate.tau),
        JointStateTrack(STD_TOPIC, names, t, effort=std.tau),
    ]
    for name in ENERGIES:
        values, deviations = getattr(estimate, name), getattr(std, name)
        if values is not None:
            tracks.append(NumberTrack(f'/{name}_energy', t, values))
            tracks.append(NumberTrack(f'/{name}_energy_std', t, deviations))
    write_mcap(path, tracks)
    progress('write', data.n_samples, data.n_samples)


WRITERS: dict[str, Writer] = {'.npz': write_prediction_npz, '.mcap': write_prediction_mcap}
