"""Exported arms, read back by other programs: the torques that these give."""

from __future__ import annotations

from collections.abc import Callable
import ctypes
import importlib.util
from pathlib import Path
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.export import mjcf, urdf
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.formats import FORMATS
from lip_id_ros.export.text import split_friction
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.couplings import coupling_matrix
from lip_id_ros.rigid_body.regressor import torque_regressor

Reader = Callable[[str, ArmDescription, Array], Array]

C_FLAGS = ('-std=c11', '-O2', '-Wall', '-Wextra', '-pedantic', '-Werror', '-shared', '-fPIC')
MANY = """
#include "arm.h"
void torques(int count, const double *q, const double *dq, const double *ddq, double *tau,
             double *kinetic, double *potential) {{
  for (int t = 0; t < count; t++)
    {name}_dynamics(q + t * {n}, dq + t * {n}, ddq + t * {n}, tau + t * {n}, kinetic + t,
                    potential + t);
}}
"""
MISSING = {
    'urdf': importlib.util.find_spec('pinocchio') is None,
    'mjcf': importlib.util.find_spec('mujoco') is None,
    'c': shutil.which('cc') is None,
}
EACH_FORMAT = pytest.mark.parametrize(
    'name',
    [
        pytest.param(name, marks=pytest.mark.skipif(MISSING[name], reason='reader is missing'))
        for name in FORMATS
    ],
)


def states_of(arm: ArmDescription, count: int, seed: int = 1) -> Array:
    """Draw q, dq, ddq evenly from the ranges of an arm, shape (3, count, n)."""
    rng, ranges = np.random.default_rng(seed), arm.ranges
    shape = count, arm.n_joints
    q = rng.uniform(ranges.q_min, ranges.q_max, shape)
    rates = [limit * rng.uniform(-1.0, 1.0, shape) for limit in (ranges.dq_max, ranges.ddq_max)]
    return np.stack([q, *rates])


def difference(
    name: str,
    text: str,
    arm: ArmDescription,
    states: Array,
    tau: Array,
    read: Reader | None = None,
) -> float:
    """
    Return the largest difference between the torques of a file and those of an arm.

    In each joint's largest torque; friction that the format cannot express is in neither.
    """
    friction = FORMATS[name].friction
    if friction is not None:
        left_out = split_friction(arm, friction).left_out
        q, dq, ddq = states
        load = torque_regressor(arm.chain, q, dq, ddq) @ arm.links.ravel()
        tau = tau - left_out.torque(q, dq, ddq, load)
    found = (read or READERS[name])(text, arm, states) - tau
    return float((np.abs(found).max(axis=0) / np.abs(tau).max(axis=0)).max())


def of_urdf(text: str, arm: ArmDescription, states: Array) -> Array:
    """Evaluate pinocchio's recursive Newton-Euler algorithm on a URDF, plus friction."""
    rotors = rotor_inertias(ET.fromstring(text), arm.joint_names)
    return of_template(text, arm, states, rotors)


def rotor_inertias(root: ET.Element, joint_names: tuple[str, ...]) -> Array:
    """Return the inertias of the rotors that an exported URDF has, shape (n,)."""
    found = {
        joint.get('name'): float(rotor.get('value', '0'))
        for transmission in root.iter('transmission')
        for joint in transmission.iter('joint')
        for rotor in transmission.iter(f'{{{urdf.DRAKE}}}rotor_inertia')
    }
    return np.array([found.get(name, 0.0) for name in joint_names])


def of_template(
    text: str, arm: ArmDescription, states: Array, rotors: Array | None = None
) -> Array:
    """Evaluate a URDF of the user, which has no place for rotors."""
    import pinocchio

    model = pinocchio.buildModelFromXML(text)
    others = [name for name in list(model.names)[1:] if name not in arm.joint_names]
    locked = [model.getJointId(name) for name in others]
    model = pinocchio.buildReducedModel(model, locked, pinocchio.neutral(model))
    model.gravity.linear = arm.chain.gravity
    model.armature = arm.links[:, ROTOR] if rotors is None else rotors
    data, neutral = model.createData(), pinocchio.neutral(model)
    found = np.array(
        [
            # the position of a continuous joint is a cosine and a sine
            pinocchio.rnea(model, data, pinocchio.integrate(model, neutral, q), *rates).copy()
            for q, *rates in zip(*states, strict=True)
        ]
    )
    dynamics = [
        ET.fromstring(text).find(f"joint[@name='{name}']/dynamics") for name in arm.joint_names
    ]
    damping, friction = (
        np.array([float(x.get(word, '0')) for x in dynamics if x is not None])
        for word in ('damping', 'friction')
    )
    return np.asarray(found + damping * states[1] + friction * smooth_signs(arm, states))


def of_mjcf(text: str, arm: ArmDescription, states: Array) -> Array:
    """Evaluate MuJoCo's inverse dynamics on an MJCF, plus Coulomb friction."""
    import mujoco

    model = mjcf.compiled(text)
    off = mujoco.mjtDisableBit
    # the Coulomb torque is a constraint there, which takes the sign from the solver
    model.opt.disableflags |= off.mjDSBL_FRICTIONLOSS | off.mjDSBL_LIMIT | off.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    found, matrix = np.empty_like(states[0]), coupling_matrix(arm.chain)
    for t, (q, dq, ddq) in enumerate(zip(*(states @ matrix.T), strict=True)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        found[t] = data.qfrc_inverse @ matrix
    values = split_friction(arm, mjcf.FRICTION).values
    coulomb = np.array([own.get('Coulomb', 0.0) for own in values])
    return np.asarray(found + coulomb * smooth_signs(arm, states))


def of_c(text: str, arm: ArmDescription, states: Array) -> Array:
    """Evaluate the C header, compiled."""
    with tempfile.TemporaryDirectory() as folder:
        library = ctypes.CDLL(str(compile_c(text, arm, Path(folder))))
        count = states.shape[1]
        found: Array = np.empty_like(states[0])
        arrays = [np.ascontiguousarray(x) for x in states] + [found, *np.empty((2, count))]
        library.torques(count, *(ctypes.c_void_p(x.ctypes.data) for x in arrays))
    return found


def compile_c(text: str, arm: ArmDescription, folder: Path) -> Path:
    """Compile a header into a library with `torques` for many states, without a warning."""
    (folder / 'arm.h').write_text(text, encoding='utf-8')
    program = MANY.format(name=arm.name, n=arm.n_joints)
    (folder / 'arm.c').write_text(program, encoding='utf-8')
    command = ['cc', *C_FLAGS, '-o', 'arm.so', 'arm.c', '-lm']
    ran = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    assert ran.returncode == 0, ran.stderr
    return folder / 'arm.so'


def smooth_signs(arm: ArmDescription, states: Array) -> Array:
    """Return the sign that the arm's Coulomb friction has, shape (N, n); the readers have none."""
    _, dq, ddq = states
    signs, basis = np.sign(dq), arm.friction.basis
    for part in basis.terms:
        if part.term.name == 'Coulomb' and len(part.drive.joints) == 1:
            joint, width = part.drive.joints[0], part.term.parameters['width']
            smooth = np.hypot(width, basis.rise_time * ddq[:, joint])
            signs[:, joint] = np.tanh(dq[:, joint] / smooth)
    return np.asarray(signs)


READERS: dict[str, Reader] = {
    'urdf': of_urdf,
    'mjcf': of_mjcf,
    'c': of_c,
}
