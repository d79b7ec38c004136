"""A simulated arm behind a real joint_trajectory_controller: errors with several feedforwards."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
import json
from pathlib import Path
import tempfile
from typing import Any

import numpy as np

from benchmarks._cells import measured, show
from benchmarks._loop_program import compiled
from benchmarks.serve_rate import MIDDLEWARES
from lip_id_ros.adaptation.payloads import known_payload
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.urdf import load_description
from lip_id_ros.export.arm import ArmDescription, JointRanges
from lip_id_ros.export.c_header import to_c_header
from lip_id_ros.friction.model import FrictionModel, plain_friction
from lip_id_ros.identification import fit
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.pseudo_inertia import BODY
from lip_id_ros.simulation.arm import panda_urdf

SOURCE = Path(__file__).with_name('arm_in_loop.cpp')
N = 7
JOINTS = tuple(f'panda_joint{i + 1}' for i in range(N))
POSTURE = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785])
ROTORS = 0.1  # kg m^2
FRICTION = 0.5  # N m, and N m s/rad
PAYLOAD, PAYLOAD_AT = 2.0, np.array([0.0, 0.03, 0.16])  # kg; m, in the frame of the last link
NOISE = 0.05  # of the efforts that are learned from [N m]
DURATION_S, N_POINTS = 6.0, 400
WAYS = ('none', 'true URDF, as KDL', 'ours, plan', 'ours, action')
COLUMNS = {
    'motion': 'motion',
    'feedforward': 'feedforward',
    'rms_mrad': 'error, rms [mrad]',
    'largest_mrad': 'largest [mrad]',
    'feedback_nm': 'feedback, rms [N m]',
    'states': 'states',
}
States = tuple[Array, Array, Array, Array]
"""Times (N,) [s], positions, velocities and accelerations (N, 7)."""


def main(arguments: list[str]) -> int:
    """Learn, track, and print a table."""
    parser = argparse.ArgumentParser(prog='benchmarks track_controller', description=__doc__)
    parser.add_argument('--model', help='of the simulated arm; left out: one is fitted')
    parser.add_argument('--motions', nargs='+', choices=MOTIONS, default=list(MOTIONS))
    parser.add_argument('--json', type=Path, help='also write the figures here')
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = compiled_arm(folder)
        model = options.model or str(folder / 'model.npz')
        if not options.model:
            fit(recording()).save(model)
        request = {'program': program, 'model': model, 'motions': options.motions}
        rows: list[dict[str, Any]] = measured(
            'benchmarks._controlled_arm', {**request, 'middleware': MIDDLEWARES[0]}
        )['rows']
    show('A simulated Panda behind a joint_trajectory_controller', COLUMNS, rows, 130)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return 0


def compiled_arm(folder: Path) -> str:
    """Compile the simulated arm behind a controller manager, with a payload and without."""
    for arm in (true_arm(), true_arm('loaded', PAYLOAD)):
        place = folder / f'{arm.name}_dynamics.h'
        place.write_text(to_c_header(arm), encoding='utf-8')
    return compiled(SOURCE, folder, ['mock_components'])


def true_arm(name: str = 'arm', payload: float = 0.0) -> ArmDescription:
    """Return the Panda of example-robot-data with rotors, friction and a payload [kg]."""
    described, ones = load_description(panda_urdf(), JOINTS, ('revolute',) * N), np.ones(N)
    basis = plain_friction(N, (0.05 * ones).tolist())
    links = described.links.copy()
    links[:, ROTOR] = ROTORS
    links[-1, :BODY] += known_payload(payload, PAYLOAD_AT)
    return ArmDescription(
        name=name,
        joint_names=JOINTS,
        chain=described.chain,
        links=links,
        friction=FrictionModel(basis, np.full(basis.size, FRICTION)),
        ranges=JointRanges(-ones, ones, ones, ones, ones),
        potential_reference=0.0 * ones,
    ).in_standard_frames()


def recording() -> Dataset:
    """Return a minute of another motion, with noise on the efforts."""
    rng = np.random.default_rng(0)
    t = np.arange(0.0, 60.0, 0.02)
    omega = 2.0 * np.pi * rng.uniform(0.1, 0.6, (4, 1, N))
    amplitude, phase = rng.uniform(0.2, 0.6, (4, 1, N)) / omega, rng.uniform(0, 6, (4, 1, N))
    angle = omega * t[:, None] + phase
    q = POSTURE + (amplitude * np.sin(angle)).sum(axis=0)
    dq = (amplitude * omega * np.cos(angle)).sum(axis=0)
    ddq = -(amplitude * omega**2 * np.sin(angle)).sum(axis=0)
    tau = true_arm().torque(q, dq, ddq) + NOISE * rng.standard_normal(q.shape)
    return Dataset.from_arrays(q, dq, ddq, tau, JOINTS, t=t)


def point_to_point() -> States:
    """From rest to rest, of degree 5."""
    t = _times()
    s = (t / DURATION_S)[:, None]
    way = np.array([0.6, 0.5, -0.5, 0.6, 0.7, -0.6, 0.8])
    return (
        t,
        POSTURE + way * s**3 * (10 - 15 * s + 6 * s**2),
        way * 30 * s**2 * (1 - s) ** 2 / DURATION_S,
        way * 60 * s * (1 - s) * (1 - 2 * s) / DURATION_S**2,
    )


def swings(periods: float, size: float = 1.0) -> States:
    """From rest to rest, with sines in between whose amplitudes fall with their number."""
    t = _times()
    s = (t / DURATION_S)[:, None]
    window = 16 * s**2 * (1 - s) ** 2
    rise = 16 * (2 * s - 6 * s**2 + 4 * s**3) / DURATION_S
    bend = 16 * (2 - 12 * s + 12 * s**2) / DURATION_S**2
    amplitude = size * np.array([0.4, 0.3, 0.4, 0.3, 0.5, 0.4, 0.6]) / np.sqrt(periods)
    omega = 2.0 * np.pi * periods / DURATION_S * np.array([1, 1, 2, 1, 2, 2, 3])
    sine, cosine = (f(omega * t[:, None]) * amplitude for f in (np.sin, np.cos))
    return (
        t,
        POSTURE + window * sine,
        rise * sine + window * omega * cosine,
        bend * sine + 2 * rise * omega * cosine - window * omega**2 * sine,
    )


def _times() -> Array:
    return np.linspace(0.0, DURATION_S, N_POINTS + 1)[1:]  # the arm is at the first point


MOTIONS: dict[str, Callable[[], States]] = {
    'point to point': point_to_point,
    'slow swings': partial(swings, 1.0),
    'fast swings': partial(swings, 3.0),
}
