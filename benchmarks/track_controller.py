"""
The paper's tracking experiment, behind a real joint_trajectory_controller.

A simulated Panda follows a reference with the torques of a nominal model as feedforward, whose
masses are wrong. A model is learned of that run. Then both are the feedforward of the same
reference and of a larger one; the learned one also of plans with few points.

"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
import json
import os
from pathlib import Path
import subprocess
import tempfile
from typing import Any

import numpy as np
from scipy.interpolate import BPoly

from benchmarks._arms import JointFriction, with_wrong_masses
from benchmarks._cells import measured, show
from benchmarks.serve_rate import MIDDLEWARES
from lip_id_ros.arrays import Array
from lip_id_ros.description.urdf import load_description
from lip_id_ros.export.arm import ArmDescription, JointRanges
from lip_id_ros.export.c_header import to_c_header
from lip_id_ros.friction.basis import plain_friction
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.settings import FitSettings, PreprocessingSettings
from lip_id_ros.simulation.arm import panda, panda_urdf
from lip_id_ros.workflow.fit import fit

SOURCE = Path(__file__).with_name('arm_in_loop.cpp')
PROGRAMS = Path(__file__).resolve().parents[1] / 'scripts' / 'jazzy_programs'
LIBRARIES = ('controller_manager', 'rclcpp', 'rcutils', 'mock_components')

N = 7
JOINTS = tuple(f'panda_joint{i + 1}' for i in range(N))
POSTURE = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
GAINS = {
    'p': np.array([600.0, 600.0, 400.0, 300.0, 200.0, 120.0, 70.0]),
    'd': np.array([40.0, 40.0, 25.0, 20.0, 10.0, 8.0, 5.0]),
}
"""Of the controller [N m/rad, N m s/rad]: nominal models have errors as large as the paper's."""

ROTORS, SIGN_WIDTH = 0.1, 0.05  # kg m^2, rad/s
FRICTION = np.full(N, 0.5)  # Coulomb and viscous [N m, N m s/rad]
MASS_SHARE, CENTRE_SHIFT = 0.2, 0.02
"""The nominal masses are wrong by up to this share, centres by so much along each axis [m]."""

LEARNED_FROM, AMPLITUDES, HORIZON_S = 0.5, (0.5, 0.6), 10.0  # rad, rad, s
PLAN_HZ, EASE_S = 100.0, 1.0
PREPROCESSING = PreprocessingSettings(cutoff_hz=12.5, max_samples=500)
"""About 50 samples a second, as the paper keeps."""

NOMINAL, INFORMED, KDL, LEARNED = 'nominal', 'nominal, true friction', 'true, as KDL', 'learned'
SPARSE, UNREFINED = 'learned, 2 points/s', 'learned, 2 points/s, none added'
THROUGH_SERVE = {LEARNED: (1, True), SPARSE: (50, True), UNREFINED: (50, False)}
"""Every so many points of the reference are sent, and whether `serve` adds others."""

FIGURES = {
    'position_nmse_percent': 'position nMSE [%]',
    'feedback_mean_square': 'mean square of the feedback [(N m)^2]',
}
States = tuple[Array, Array, Array]
"""Positions, velocities and accelerations (N, 7)."""

Feedforward = Callable[[Array, Array, Array], Array]
"""Torques of states, both (N, 7)."""


def main(arguments: list[str]) -> int:
    """Learn, track, and print two tables."""
    parser = argparse.ArgumentParser(prog='benchmarks track_controller', description=__doc__)
    parser.add_argument('--seeds', type=int, nargs='+', default=[0], help='of nominal models')
    parser.add_argument('--amplitudes', type=float, nargs='+', default=AMPLITUDES, help='[rad]')
    parser.add_argument('--horizon', type=float, default=HORIZON_S, help='of each run [s]')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    options = parser.parse_args(arguments)
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        request = {'program': compiled_arm(Path(name)), 'middleware': MIDDLEWARES[0]}
        request |= {'amplitudes': options.amplitudes, 'horizon': options.horizon}
        for seed in options.seeds:
            rows += measured('benchmarks._controlled_arm', {**request, 'seed': seed})['rows']
    for key, title in FIGURES.items():
        print_medians(rows, key, title)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return 0


def print_medians(rows: Sequence[dict[str, Any]], key: str, title: str) -> None:
    """Print medians of a figure over the seeds, and its least ratio to that of the learned one."""
    cells: dict[tuple[float, str], list[list[float]]] = {}
    for row in rows:
        cells.setdefault((row['amplitude'], row['feedforward']), []).append(row[key])
    table = [
        {
            'amplitude': amplitude,
            'feedforward': name,
            **dict(zip(JOINTS, np.median(found, axis=0).tolist(), strict=True)),
            'ratio': float((found / np.array(cells[amplitude, LEARNED])).min()),
        }
        for (amplitude, name), found in cells.items()
    ]
    joints = {joint: f'J{number + 1}' for number, joint in enumerate(JOINTS)}
    columns = {'amplitude': 'A [rad]', 'feedforward': 'feedforward', **joints}
    show(title, {**columns, 'ratio': 'least / learned'}, table, 140)


# the arm, and what is known of it


def true_arm() -> ArmDescription:
    """Return the Panda of example-robot-data with rotors and friction."""
    described, ones = load_description(panda_urdf(), JOINTS, ('revolute',) * N), np.ones(N)
    basis = plain_friction(N, (SIGN_WIDTH * ones).tolist())
    viscous_coulomb_offset = np.stack([FRICTION, FRICTION, 0.0 * FRICTION], axis=1).ravel()
    links = described.links.copy()
    links[:, ROTOR] = ROTORS
    return ArmDescription(
        name='arm',
        joint_names=JOINTS,
        chain=described.chain,
        links=links,
        friction=FrictionModel(basis, viscous_coulomb_offset),
        ranges=JointRanges(-ones, ones, ones, ones, ones),
        potential_reference=0.0 * ones,
    ).in_standard_frames()


def feedforwards(seed: int) -> dict[str, Feedforward]:
    """Return torques of a nominal model, of it with friction and rotors, and of the true links."""
    arm, friction = panda(), JointFriction(FRICTION, FRICTION, SIGN_WIDTH)
    wrong = with_wrong_masses(arm, MASS_SHARE, CENTRE_SHIFT, np.random.default_rng(seed))

    def informed(q: Array, dq: Array, ddq: Array) -> Array:
        return wrong.inverse_dynamics(q, dq, ddq) + ROTORS * ddq + friction.torque(dq)

    return {NOMINAL: wrong.inverse_dynamics, INFORMED: informed, KDL: arm.inverse_dynamics}


def learned(samples: JointSamples) -> InverseDynamicsModel:
    """Fit the arm to a run."""
    return fit(preprocess(samples, PREPROCESSING), FitSettings())


# the reference


def growing_cosine(t: Array, amplitude: float, horizon: float) -> States:
    """
    Return the paper's reference (eq. `ref_ctrl`) at times (N,): every joint swings ever further.

    The paper's has no posture, without which a Panda's fourth joint would have to reach zero.
    """
    time, slope = t[:, None] * np.ones(N), amplitude / horizon
    sine, cosine = np.sin(np.pi * time), np.cos(np.pi * time)
    return (
        POSTURE + slope * time * cosine,
        slope * (cosine - np.pi * time * sine),
        -slope * np.pi * (2.0 * sine + np.pi * time * cosine),
    )


def reference(amplitude: float, horizon: float) -> tuple[Array, States]:
    """Return the times of a plan and its states: from rest into the motion, and to rest again."""
    t = np.arange(1, round(PLAN_HZ * (horizon + 2.0 * EASE_S)) + 1) / PLAN_HZ
    since, still = t - EASE_S, np.zeros(N)
    ends = np.stack(growing_cosine(np.array([0.0, horizon]), amplitude, horizon), axis=1)
    before, after = (
        q + way * dq for (q, dq, _), way in zip(ends, (-0.5 * EASE_S, 0.5 * EASE_S), strict=True)
    )
    begin = BPoly.from_derivatives([-EASE_S, 0.0], [[before, still, still], ends[0]])
    end = BPoly.from_derivatives([horizon, horizon + EASE_S], [ends[1], [after, still, still]])
    moving = growing_cosine(np.clip(since, 0.0, horizon), amplitude, horizon)
    q, dq, ddq = (
        np.select(
            [since[:, None] < 0.0, since[:, None] > horizon],
            [begin.derivative(order)(since), end.derivative(order)(since)],
            values,
        )
        for order, values in enumerate(moving)
    )
    return t, (q, dq, ddq)


def compiled_arm(folder: Path) -> str:
    """Compile the simulated arm behind a controller manager."""
    header = folder / 'arm_dynamics.h'
    header.write_text(to_c_header(true_arm()), encoding='utf-8')
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    places = [Path(prefix) / 'lib' for prefix in prefixes]
    place = next(each for each in places if (each / 'libcontroller_manager.so').is_file())
    program = folder / SOURCE.stem
    command: list[str | Path] = ['g++', '-std=c++17', '-O2', '-w', '-pthread', '-rdynamic']
    command += ['-o', program, SOURCE, '-I', folder, '-I', PROGRAMS]
    command += [place / f'lib{name}.so' for name in LIBRARIES]
    subprocess.run([*command, f'-Wl,-rpath,{place}', '-Wl,--allow-shlib-undefined'], check=True)
    return str(program)
