"""Files of predictions: npz for programs, MCAP for plotting tools."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import os
from pathlib import Path
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError
from lip_id_ros.evaluation.prediction import Outcome, standard_deviation
from lip_id_ros.files import read_header, write_npz
from lip_id_ros.model import DynamicsModel, TorqueModel
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording.bag_writer import JointStateTrack, NumberTrack, Track, write_mcap

FORMAT = 'lip_id_ros prediction'
VERSION = 1
SUMMARY_BYTES = 2**16
MEASURED_TOPIC, PREDICTED_TOPIC = '/measured', '/predicted'
TORQUE_TOPICS = {
    'tau': PREDICTED_TOPIC,
    'tau_std': '/predicted_std',
    'measurement_std': '/measurement_std',
}
TORQUES = ('tau', 'inertial', 'coriolis', 'gravity', 'friction')
ENERGIES = ('kinetic', 'potential')
PAUSE_S = 1.0
"""Between recordings whose times would overlap."""
UNITS = {
    't': 's',
    **dict.fromkeys((*TORQUES, 'tau_std', 'measurement_std', 'tau_measured'), 'N m or N'),
    **dict.fromkeys((*ENERGIES, 'kinetic_std', 'potential_std'), 'J'),
}


Values = Mapping[str, Array]
"""Predictions by the names of interfaces.md."""
Writer = Callable[[str, Dataset, Values], None]


def writer_for(path: str | os.PathLike[str]) -> Writer:
    """Return the writer of a prediction file for its suffix; ConfigError if it has none."""
    suffix = Path(path).suffix
    if suffix not in WRITERS:
        raise ConfigError(
            f'{os.fspath(path)} must end in {" or ".join(WRITERS)}, '
            'the format of the prediction; rename it.'
        )
    return WRITERS[suffix]


def is_prediction(path: Path) -> bool:
    """Whether a file is a prediction: npz with its format, or MCAP with its topics."""
    if path.suffix == '.mcap':
        # The summary at the end of an MCAP file names its topics in plain bytes.
        with open(path, 'rb') as file:
            file.seek(-min(SUMMARY_BYTES, path.stat().st_size), os.SEEK_END)
            end = file.read()
        return all(topic.encode() in end for topic in (MEASURED_TOPIC, PREDICTED_TOPIC))
    try:
        return read_header(path).get('format') == FORMAT
    except ValueError:
        return False


def predicted_values(model: TorqueModel, outcome: Outcome, progress: Progress = silent) -> Values:
    """Return torques, and the parts, energies and standard deviations that the model has."""
    found = {name: getattr(outcome.prediction, name, None) for name in (*TORQUES, *ENERGIES)}
    if isinstance(model, DynamicsModel):
        std = standard_deviation(model, outcome.dataset, progress)
        found |= {f'{name}_std': getattr(std, name) for name in ('tau', 'measurement', *ENERGIES)}
    return {name: values for name, values in found.items() if values is not None}


def write_prediction_npz(path: str | os.PathLike[str], data: Dataset, found: Values) -> None:
    """Write predictions beside the measurement; see interfaces.md."""
    arrays: dict[str, Any] = {'t': data.t, 'segment': data.segment, 'tau_measured': data.tau}
    arrays |= found
    units = {name: unit for name, unit in UNITS.items() if name in arrays}
    names = {'joint_names': np.array(data.joint_names)}
    write_npz(path, arrays | names, {'format': FORMAT, 'version': VERSION, 'units': units})


def stamps(data: Dataset) -> Array:
    """Return times by the clocks of the recordings, each after the one before, shape (N,)."""
    sources, t, end = data.provenance.get('sources', ()), data.t.copy(), -PAUSE_S
    for number in np.unique(data.recording).tolist():
        rows = data.recording == number
        source = sources[number] if 0 <= number < len(sources) else None
        known = source.get('start_s', 0.0) if isinstance(source, Mapping) else 0.0
        begin = float(t[rows].min())
        t[rows] += max(known, end + PAUSE_S - begin)
        end = float(t[rows].max())
    return t


def write_prediction_mcap(path: str | os.PathLike[str], data: Dataset, found: Values) -> None:
    """Write measured and predicted effort, energies and standard deviations as topics."""
    names, t = data.joint_names, stamps(data)
    tracks: list[Track] = [JointStateTrack(MEASURED_TOPIC, names, t, data.q, data.dq, data.tau)]
    for name, topic in TORQUE_TOPICS.items():
        if (torques := found.get(name)) is not None:
            tracks.append(JointStateTrack(topic, names, t, effort=torques))
    for name in ENERGIES:
        for ending in ('', '_std'):
            if (energy := found.get(f'{name}{ending}')) is not None:
                tracks.append(NumberTrack(f'/{name}_energy{ending}', t, energy))
    write_mcap(path, tracks)


WRITERS: dict[str, Writer] = {'.npz': write_prediction_npz, '.mcap': write_prediction_mcap}
