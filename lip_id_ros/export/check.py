"""Exported arms, read by other programs, against the torques that they are to give."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from pathlib import Path
import shutil
import subprocess
import tempfile
from typing import Any
import xml.etree.ElementTree as ET

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import LipIdError, ModelError
from lip_id_ros.export import mjcf, urdf
from lip_id_ros.export.arm import ArmDescription
from lip_id_ros.export.text import split_friction, term_name
from lip_id_ros.friction.drives import DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.couplings import coupling_matrix
from lip_id_ros.rigid_body.regressor import torque_regressor

COMPILERS = ('cc', 'gcc', 'clang')
C_FLAGS = ('-std=c11', '-O2', '-Wall', '-Wextra', '-pedantic', '-Werror', '-shared', '-fPIC')
MANY = """
#include "{header}"
void torques(int count, const double *q, const double *dq, const double *ddq, double *tau,
             double *kinetic, double *potential) {{
  for (int t = 0; t < count; t++)
    {name}_dynamics(q + t * {n}, dq + t * {n}, ddq + t * {n}, tau + t * {n}, kinetic + t,
                    potential + t);
}}
"""


@dataclass(frozen=True)
class Agreement:
    """
    How well a format gives the torques of a model, as the program `reader` evaluates it.

    `difference`, shape (n,): largest difference of each joint's torque over that joint's largest.
    `left_out`: terms of friction that the format cannot express, left out on both sides.
    `lacking`, shape (n,): largest torque of these terms over each joint's largest.
    """

    reader: str
    arm: ArmDescription
    difference: Array
    left_out: tuple[DriveTerm, ...]
    lacking: Array
    n_states: int

    def sentence(self, of_what: str) -> str:
        """Return the result in words; `of_what` names what the torques were compared with."""
        names = sorted({term_name(part) for part in self.left_out})
        without = f' without {", ".join(names)}' if names else ''
        gravity = np.linalg.norm(self.arm.chain.gravity)
        said = (
            f'{self.reader} gives the torques of {of_what}{without}, to '
            f'{self.difference.max():.1e} of the largest, at {self.n_states} random states and '
            f'a gravity of {gravity:.6g} m/s^2.'
        )
        if not self.left_out:
            return said
        worst = int(self.lacking.argmax())
        return (
            f'{said} The file lacks that friction: up to {100.0 * self.lacking[worst]:.2g} % of '
            f'the largest torque at {self.arm.joint_names[worst]}.'
        )

    def require(self, tolerance: float, remedy: str = 'report this fault of lip_id_ros') -> None:
        """ModelError where the difference is larger; `remedy` says what to do then."""
        if not self.difference.max() <= tolerance:
            raise ModelError(
                f'{self.reader} was to give the same torques to {tolerance:g}, but they differ by '
                f'{self.difference.max():.1e} of the largest; {remedy}.'
            )


def check_urdf(text: str, arm: ArmDescription, tau: Array, states: Array) -> Agreement:
    """
    Compare pinocchio's recursive Newton-Euler algorithm on a URDF, plus friction.

    `tau`, shape (N, n): what the arm is to give at `states`, shape (3, N, n).
    """
    root = ET.fromstring(text)
    return _check_urdf(text, arm, tau, states, urdf.rotor_inertias(root, arm.joint_names))


def check_template(text: str, arm: ArmDescription, tau: Array, states: Array) -> Agreement:
    """Compare a URDF of the user with what was fitted, rotors added; else as `check_urdf`."""
    return _check_urdf(text, arm, tau, states, arm.links[:, ROTOR])


def _check_urdf(
    text: str, arm: ArmDescription, tau: Array, states: Array, rotors: Array
) -> Agreement:
    pinocchio = _import_pinocchio()
    model = _locked(pinocchio, pinocchio.buildModelFromXML(text), arm.joint_names)
    model.gravity.linear = arm.chain.gravity
    root = ET.fromstring(text)
    model.armature = rotors
    data, neutral, dq = model.createData(), pinocchio.neutral(model), states[1]
    found = np.array(
        [
            # the position of a continuous joint is a cosine and a sine
            pinocchio.rnea(model, data, pinocchio.integrate(model, neutral, q), *rates).copy()
            for q, *rates in zip(*states, strict=True)
        ]
    )
    dynamics = [root.find(f"joint[@name='{name}']/dynamics") for name in arm.joint_names]
    damping, friction = (
        np.array([float(x.get(word, '0')) for x in dynamics if x is not None])
        for word in ('damping', 'friction')
    )
    found += damping * dq + friction * _smooth_signs(arm, states)
    left_out = split_friction(arm, urdf.FRICTION).left_out
    return _agreement('pinocchio', found, arm, tau, states, left_out)


def _locked(pinocchio: Any, model: Any, joint_names: tuple[str, ...]) -> Any:
    others = [model.getJointId(name) for name in list(model.names)[1:] if name not in joint_names]
    return pinocchio.buildReducedModel(model, others, pinocchio.neutral(model))


def check_mjcf(text: str, arm: ArmDescription, tau: Array, states: Array) -> Agreement:
    """Compare MuJoCo's inverse dynamics on an MJCF; parameters as of `check_urdf`."""
    mujoco = mjcf.import_mujoco()
    model = mjcf.compiled(text)
    off = mujoco.mjtDisableBit
    # The Coulomb torque is a constraint there, which takes the sign from the solver.
    model.opt.disableflags |= off.mjDSBL_FRICTIONLOSS | off.mjDSBL_LIMIT | off.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    found, matrix = np.empty_like(tau), coupling_matrix(arm.chain)
    for t, (q, dq, ddq) in enumerate(zip(*(states @ matrix.T), strict=True)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        found[t] = data.qfrc_inverse @ matrix
    split = split_friction(arm, mjcf.FRICTION)
    coulomb = np.array([own.get('Coulomb', 0.0) for own in split.values])
    found += coulomb * _smooth_signs(arm, states)
    left_out = split.left_out
    return _agreement('MuJoCo', found, arm, tau, states, left_out)


def check_c_header(text: str, arm: ArmDescription, tau: Array, states: Array) -> Agreement:
    """Compare the compiled C header; parameters as of `check_urdf`."""
    with tempfile.TemporaryDirectory() as folder:
        library = ctypes.CDLL(str(compile_c(text, arm, Path(folder))))
        found, count = np.empty(tau.shape), len(tau)
        energies = np.empty((2, count))
        arrays = [np.ascontiguousarray(x) for x in states] + [found, *energies]
        library.torques(count, *(ctypes.c_void_p(x.ctypes.data) for x in arrays))
    return _agreement('C', found, arm, tau, states, None)


def compile_c(text: str, arm: ArmDescription, folder: Path) -> Path:
    """Compile a header into a library with `torques` for many states; LipIdError on failure."""
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    if compiler is None:
        raise LipIdError(
            f'the C header is checked by compiling it, but none of {", ".join(COMPILERS)} is '
            'installed; install one of them.'
        )
    header, source, library = folder / 'arm.h', folder / 'arm.c', folder / 'arm.so'
    header.write_text(text, encoding='utf-8')
    program = MANY.format(header=header.name, name=arm.name, n=arm.n_joints)
    source.write_text(program, encoding='utf-8')
    command = [compiler, *C_FLAGS, '-o', str(library), str(source), '-lm']
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if ran.returncode != 0:
        lines = ran.stderr.strip().splitlines() or ['no reason']
        found = next((line for line in lines if 'error' in line), lines[0])
        raise LipIdError(
            f'the C header was to compile without a warning, but {compiler} found '
            f'{found}; report this fault of lip_id_ros.'
        )
    return library


def _smooth_signs(arm: ArmDescription, states: Array) -> Array:
    """Return the sign that the arm's Coulomb friction has, shape (N, n); the readers have none."""
    q, dq, ddq = states
    signs, basis = np.sign(dq), arm.friction.basis
    for part in basis.terms:
        if part.term.name == 'Coulomb' and len(part.drive.joints) == 1:
            joint = part.drive.joints[0]
            state = part.drive.state(q, dq, ddq, np.zeros_like(dq), basis.rise_time)
            signs[:, joint] = part.term.features(state)[:, 0]
    return np.asarray(signs)


def _agreement(
    reader: str,
    found: Array,
    arm: ArmDescription,
    tau: Array,
    states: Array,
    left_out: FrictionModel | None,
) -> Agreement:
    lacking = np.zeros_like(tau)
    terms: tuple[DriveTerm, ...] = ()
    if left_out is not None:
        q, dq, ddq = states
        load = torque_regressor(arm.chain, q, dq, ddq) @ arm.links.ravel()
        lacking, terms = left_out.torque(q, dq, ddq, load), left_out.basis.terms
    largest = np.abs(tau).max(axis=0)
    difference, lacked = (
        np.abs(x).max(axis=0) / np.where(largest > 0.0, largest, 1.0)
        for x in (found - (tau - lacking), lacking)
    )
    return Agreement(reader, arm, difference, terms, lacked, len(tau))


def _import_pinocchio() -> Any:
    try:
        import pinocchio  # optional: only simulations and this check need it
    except ImportError as error:
        raise LipIdError(
            f'the URDF is checked by pinocchio, which is missing ({error}); '
            "install it with `pip install 'lip_id_ros[sim]'`."
        ) from error
    return pinocchio
