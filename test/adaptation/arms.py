"""Arms that are known, with a posterior around the truth, and streams of their torques."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

from model.models import of_arm
import numpy as np
from rigid_body.arms import random_bodies, random_chain

from lip_id_ros.adaptation.updates import Update
from lip_id_ros.arrays import Array
from lip_id_ros.friction.basis import FrictionBasis, plain_friction
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.friction.terms import dahl
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior

KINDS, TYPES = 'RRR', ('revolute',) * 3
WIDTH, NOISE, SHARE = 0.05, 0.02, 0.02
RATE_HZ = 20.0
RANGES = np.array([1.5, 2.0, 5.0])[:, None, None]
"""Of q, dq and ddq in the training data, to both sides."""


class Stream(NamedTuple):
    """Times (N,) and q, dq, ddq, tau, each of shape (N, n)."""

    t: Array
    q: Array
    dq: Array
    ddq: Array
    tau: Array


def known_model(memory: bool = False) -> InverseDynamicsModel:
    """Return a model of three joints whose posterior is a share of its parameters."""
    rng = np.random.default_rng(5)
    n = len(KINDS)
    terms = plain_friction(n, np.full(n, WIDTH)).terms
    values = np.tile([0.8, 0.6, 0.05], n)
    if memory:
        terms += (DriveTerm(Drive.of_joint(1), dahl(WIDTH, 0.01)),)
        values = np.append(values, 0.5)
    friction = FrictionModel(FrictionBasis(n, terms), values)
    links = random_bodies(n, rng)
    std = SHARE * np.concatenate([np.zeros(6 * n), np.abs(links).ravel(), values])
    arm = ArmPosterior(
        chain=random_chain(KINDS, rng),
        links=links,
        friction=friction,
        noise=TorqueNoise.constant(np.full(n, NOISE)),
        covariance_root=np.diag(std),
    )
    ranges = RANGES[:, 0] * np.ones(n)
    model = of_arm(arm, TYPES)
    return replace(model, training_range=(-ranges, ranges), known_states=None)


def correlated_model() -> InverseDynamicsModel:
    """Return the known arm, with a posterior in which links and friction depend on each other."""
    model = known_model()
    assert model.arm is not None
    root = model.arm.covariance_root
    mixed = np.random.default_rng(8).normal(size=root.shape) / np.sqrt(len(root))
    scale = np.diagonal(root)[:, None]
    return replace(model, arm=replace(model.arm, covariance_root=root + scale * mixed))


def message_of(update: Update) -> Any:
    """Return an update with the fields of a control_msgs/DynamicInterfaceGroupValues."""
    sec, nanosec = divmod(update.stamp_ns, 10**9)
    names, values = update.interface
    return SimpleNamespace(
        header=SimpleNamespace(
            stamp=SimpleNamespace(sec=sec, nanosec=nanosec), frame_id=update.source
        ),
        interface_groups=[update.model],
        interface_values=[SimpleNamespace(interface_names=names, values=values)],
    )


def with_friction(model: InverseDynamicsModel, factor: float) -> InverseDynamicsModel:
    """Return an arm with another viscous and dry friction."""
    assert model.arm is not None
    friction = model.arm.friction
    changed = FrictionModel(friction.basis, factor * friction.coefficients)
    return replace(model, arm=replace(model.arm, friction=changed))


def stream(
    model: InverseDynamicsModel, seconds: float, seed: int = 0, start: float = 0.0
) -> Stream:
    """Return a motion of random sinusoids with the torques of an arm."""
    rng = np.random.default_rng(seed)
    t = start + np.arange(0.0, seconds, 1.0 / RATE_HZ)
    w = 2.0 * np.pi * rng.uniform(0.05, 0.4, (model.n_joints, 5))
    phase = t[:, None, None] * w + rng.uniform(0.0, 2.0 * np.pi, w.shape)
    a = rng.uniform(0.2, 0.5, w.shape)
    parts = a * np.sin(phase), a * w * np.cos(phase), -a * w**2 * np.sin(phase)
    q, dq, ddq = (each.sum(axis=2) for each in parts)
    clean = model.predict(q, dq, ddq, t).tau
    return Stream(t, q, dq, ddq, clean + NOISE * rng.standard_normal(clean.shape))
