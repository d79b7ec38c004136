"""A payload in the words of robots' drivers, and in a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import json
import os

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError
from lip_id_ros.identification.payload import LoadedArm, Payload
from lip_id_ros.identification.payload_problem import with_body
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import compacted
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.denavit_hartenberg import displaced, STEP, with_standard_frames
from lip_id_ros.rigid_body.pseudo_inertia import BODY, in_other_frames
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

HEAD = '# payload found by lip_id_ros'
HALF = 0.5
LEAST_MASS = 0.1
"""A mass is identified where its deviation is below half of it, or below this [kg]."""


def require_links(model: InverseDynamicsModel, place: str) -> None:
    """Raise ModelError, which names the model's file, where a payload cannot be added to it."""
    if model.arm is None:
        raise ModelError(
            f'a payload is added to rigid links, but {place} has none; fit with the default '
            'kernel.'
        )


def residual_gp_cautions(model: InverseDynamicsModel) -> list[str]:
    """Return sentences on Gaussian processes of a model, which do not know the payload."""
    if model.residual_gp is None:
        return []
    names, instead = np.array(model.joint_names), model.residual_gp.replaces
    cautions = []
    if beside := names[model.residual_gp.joints & ~instead].tolist():
        cautions.append(
            f'The Gaussian processes beside the links at {", ".join(beside)} were learned without '
            'the payload, and correct the arm with it as they do without.'
        )
    if replaced := names[instead].tolist():
        cautions.append(
            f'The Gaussian processes in place of the links at {", ".join(replaced)} would not '
            'bear the payload: with it, links and friction give the torques there.'
        )
    return cautions


def mass_cautions(mass: float, mass_std: float) -> list[str]:
    """Return a sentence where the torques show no mass, or not which, as on one vertical axis."""
    if mass_std > max(HALF * mass, LEAST_MASS):
        return [
            f'The mass is not identified: its standard deviation is {mass_std:.3g} kg; '
            'move joints that lift the payload.'
        ]
    if mass <= 2.0 * mass_std:
        return [
            'No payload is found: the mass is within two standard deviations of zero; do not use '
            'its centre of mass and inertia.'
        ]
    return []


def payload_in_flange(loaded: LoadedArm, shift: float, turn: float) -> Payload:
    """
    Express a payload in a frame that is fixed to the last link, where it is uncertain too.

    The frame is shifted along [m] and turned about [degrees] the z axis of the last link's frame
    by the convention of Denavit and Hartenberg, as `lip_id export` writes it.
    """
    rotation = Rotation.from_euler('z', turn, degrees=True).as_matrix()[None]
    translation = np.array([[0.0, 0.0, shift]])

    def moved(body: Array, placements: Array) -> Array:
        chain = displaced(loaded.arm.chain, placements)
        links = np.zeros((len(chain.prismatic), LINK_PARAMETERS))
        links[-1, :BODY] = body
        standard = with_standard_frames(chain, links)[1][-1:]
        return in_other_frames(standard, rotation, translation)[0, :BODY]

    still = np.zeros(DIRECTIONS * len(loaded.arm.links))
    by_body = np.stack([moved(unit, still) for unit in np.eye(BODY)], axis=1)
    by_placement = [
        (moved(loaded.body, step) - moved(loaded.body, -step)) / (2.0 * STEP)
        for step in STEP * np.eye(len(still))
    ]
    placements_root = loaded.arm.covariance_root[: len(still)]
    root = by_body @ loaded.body_root + np.stack(by_placement, axis=1) @ placements_root
    return Payload(moved(loaded.body, still), root @ root.T)


def attached(model: InverseDynamicsModel, loaded: LoadedArm) -> InverseDynamicsModel:
    """Return a model of the arm with a payload, in which every joint has links."""
    n, arm = model.n_joints, with_body(loaded.arm, loaded.body)
    first = DIRECTIONS * n + LINK_PARAMETERS * (n - 1)
    root = arm.covariance_root.copy()
    root[first : first + BODY] += loaded.body_root
    arm = compacted(replace(arm, covariance_root=root), model.training_range)
    noted = {**model.provenance, 'payload_mass': float(loaded.body[0])}
    beside = None if model.residual_gp is None else model.residual_gp.beside_links()
    return replace(model, arm=arm, residual_gp=beside, provenance=noted)


def to_yaml(payload: Payload, sources: Sequence[str], flange: tuple[float, float]) -> str:
    """
    Return a payload as YAML, also as the drivers of UR and Franka robots take it.

    `ur_script` is a line of URScript, `ur_set_payload` a request of ur_msgs/srv/SetPayload in
    Jazzy, `franka_set_load` one of franka_msgs/srv/SetLoad, which libfranka's `setLoad` takes.
    """
    inertia = inertias(payload)
    centre = [float(value) for value in payload.centre]
    x, y, z = centre
    ur = {f'i{name}': inertia[name] for name in ('xx', 'yy', 'zz', 'xy', 'xz', 'yz')}
    entries = {
        'recordings': list(sources),
        'flange': {'shift_m': flange[0], 'turn_deg': flange[1]},
        'mass': payload.mass,
        'mass_std': payload.mass_std,
        'centre_of_mass': centre,
        'centre_of_mass_std': [float(value) for value in payload.centre_std],
        'inertia_about_centre_of_mass': inertia,
        'ur_script': f'set_target_payload({payload.mass!r}, {centre!r}, {list(ur.values())!r})',
        'ur_set_payload': {
            'mass': payload.mass,
            'center_of_gravity': {'x': x, 'y': y, 'z': z},
            **ur,
        },
        'franka_set_load': {
            'mass': payload.mass,
            'center_of_mass': centre,
            'load_inertia': [float(value) for value in payload.inertia.T.ravel()],  # by columns
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
