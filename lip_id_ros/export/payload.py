"""A payload in the words of robots' drivers, and in a model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
import json
import os

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError
from lip_id_ros.identification.payload import BODY, Payload, with_body
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.denavit_hartenberg import with_standard_frames
from lip_id_ros.rigid_body.pseudo_inertia import in_other_frames

HEAD = '# payload found by lip_id_ros'

PLACEMENT = 6
"""Coordinates of a joint's placement in the covariance of an arm."""


def links_of(model: InverseDynamicsModel, place: str) -> ArmPosterior:
    """
    Return the arm of a model.

    Parameters
    ----------
    model : InverseDynamicsModel
    place : str
        Its file, for the message.

    Raises
    ------
    ModelError
        If it has no rigid links.

    """
    if model.arm is None:
        raise ModelError(
            f'a payload is added to rigid links, but {place} has none; fit with the default '
            'kernel.'
        )
    return model.arm


def payload_in_flange(chain: Chain, payload: Payload, shift: float, turn: float) -> Payload:
    """
    Express a payload in a frame that is fixed to the last link.

    Parameters
    ----------
    chain : Chain
    payload : Payload
        In the frame of the chain's last link.
    shift, turn : float
        Of the frame along [m] and about [degrees] the z axis of the last link's frame by the
        convention of Denavit and Hartenberg, as `lip_id export` writes it.

    """
    rotation = Rotation.from_euler('z', turn, degrees=True).as_matrix()[None]

    def moved(body: Array) -> Array:
        links = np.zeros((len(chain.prismatic), LINK_PARAMETERS))
        links[-1, :BODY] = body
        standard = with_standard_frames(chain, links)[1][-1:]
        return in_other_frames(standard, rotation, np.array([[0.0, 0.0, shift]]))[0, :BODY]

    return _transformed(payload, moved)


def _transformed(payload: Payload, moved: Callable[[Array], Array]) -> Payload:
    matrix = np.stack([moved(unit) for unit in np.eye(BODY)], axis=1)
    return Payload(matrix @ payload.parameters, matrix @ payload.covariance @ matrix.T)


def attached(model: InverseDynamicsModel, payload: Payload) -> InverseDynamicsModel:
    """
    Return a model of the arm with a payload.

    Parameters
    ----------
    model : InverseDynamicsModel
        Of an arm.
    payload : Payload
        In the frame of the last link of the model's chain.

    """
    arm = links_of(model, 'this model')
    n = model.n_joints
    first = PLACEMENT * n + LINK_PARAMETERS * (n - 1)
    own = np.zeros((len(arm.covariance_root), BODY))
    values, vectors = np.linalg.eigh(payload.covariance)
    own[first : first + BODY] = vectors * np.sqrt(np.maximum(values, 0.0))
    root = np.concatenate([arm.covariance_root, own], axis=1)
    noted = {**model.provenance, 'payload_mass': payload.mass}
    return replace(
        model,
        arm=replace(with_body(arm, payload.parameters), covariance_root=root),
        provenance=noted,
    )


def to_yaml(payload: Payload, sources: Sequence[str], flange: tuple[float, float]) -> str:
    """Return a payload as YAML, also as the drivers of UR and Franka robots take it."""
    inertia = inertias(payload)
    by_columns = [float(value) for value in payload.inertia.T.ravel()]
    centre = [float(value) for value in payload.centre]
    ur = [inertia[name] for name in ('xx', 'yy', 'zz', 'xy', 'xz', 'yz')]
    entries = {
        'recordings': list(sources),
        'flange': {'shift_m': flange[0], 'turn_deg': flange[1]},
        'mass': payload.mass,
        'mass_std': payload.mass_std,
        'centre_of_mass': centre,
        'centre_of_mass_std': [float(value) for value in payload.centre_std],
        'inertia_about_centre_of_mass': inertia,
        'ur_script': f'set_target_payload({payload.mass!r}, {centre!r}, {ur!r})',
        'franka_set_load': {
            'load_mass': payload.mass,
            'F_x_Cload': centre,
            'load_inertia': by_columns,
        },
    }
    lines = [f'{name}: {json.dumps(value)}' for name, value in entries.items()]
    head = f'{HEAD}: kg, m, kg m^2, in the frame of the flange'
    return '\n'.join([head, *lines]) + '\n'


def is_payload(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a payload as YAML."""
    with open(path, 'rb') as file:
        return file.read(len(HEAD)) == HEAD.encode()


def inertias(payload: Payload) -> dict[str, float]:
    """Return the entries of the inertia about the centre of mass [kg m^2]."""
    values = payload.inertia[np.triu_indices(3)]
    names = ('xx', 'xy', 'xz', 'yy', 'yz', 'zz')
    return {name: float(value) for name, value in zip(names, values, strict=True)}
