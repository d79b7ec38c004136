"""Samples of simulated arms for kinematic calibration, and gradients of costs."""

from __future__ import annotations

from typing import Any

from gp.arms import noise_of
from gp.chains import ChainArm, random_arm
import numpy as np

from lip_id_ros.identification.kinematic_calibration import Samples
from lip_id_ros.rigid_body.chain import NO_COUPLINGS


def samples_of(
    joint_types: tuple[str, ...],
    count: int = 120,
    noise: float = 1e-3,
    seed: int = 5,
    gravity: float = 9.81,
) -> tuple[ChainArm, Samples]:
    arm = random_arm(joint_types, seed, gravity)
    q, dq, ddq = arm.motion(count, seed=0)
    tau = arm.torque(q, dq, ddq)
    size = np.sqrt(np.mean(tau**2))
    link_std = size * np.tile([1.0, *[0.3] * 3, *[0.1] * 7], (len(joint_types), 1))
    samples = Samples(
        q, dq, ddq,
        tau + noise_of(tau, noise),
        arm.chain.prismatic,
        np.array([0.0, 0.0, -gravity]),
        NO_COUPLINGS,
        np.zeros((*tau.shape, 0)),
        link_std,
        np.zeros(0),
        np.ones_like(tau),
    )  # fmt: skip
    return arm, samples


def assert_gradient(problem: Any, at: Any, rtol: float, atol: float) -> None:
    """
    Compare the gradient of a cost with differences.

    `atol` is a share of its largest entry, beside what rounding makes of the differences.
    """
    step, (_, found) = 1e-6, problem.normal_equations(at)
    expected = [
        (problem.stepped(at, way).cost - problem.stepped(at, -way).cost) / (2.0 * step)
        for way in step * np.eye(len(found))
    ]
    np.testing.assert_allclose(
        found, expected, rtol=rtol, atol=atol * np.abs(expected).max() + 1e-9 * at.cost
    )
