"""Models with random weights and random data: every formula must hold for them, too."""

from __future__ import annotations

from dataclasses import replace

from gp.cases import random_hyperparameters, random_kernel, TYPES
from gp.chains import random_body
from gp.processes import process_of
from kernels.cases import MEMBERS, R, random_chain, random_states
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.basis import FrictionBasis, plain_friction
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.friction.terms import load_coulomb, load_torque, viscous
from lip_id_ros.kernels import TorquePosterior, TorquePrior
from lip_id_ros.kernels.program import without_potential
from lip_id_ros.model import EffortCalibration, InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.model.known_states import KnownStates, stored_states
from lip_id_ros.model.residual_gp import (
    correlation,
    Inputs,
    ResidualGP,
    stored_inputs,
    stored_weights,
)
from lip_id_ros.rigid_body.couplings import Coupling, rows_of

KERNELS = (*MEMBERS, ARTICULATED)


def random_model(
    member: str,
    types: tuple[str, ...] = TYPES,
    n_samples: int = 7,
    friction: bool = True,
    residual_gp: bool = True,
    seed: int = 0,
) -> InverseDynamicsModel:
    """Return a model that is conditioned on random torques; `ARTICULATED` is a random arm."""
    rng = np.random.default_rng(seed)
    if member == ARTICULATED:
        arm = random_arm(types, rng)
        return of_arm(arm, types, random_residual_gp(types, rng) if residual_gp else None)
    kernel = random_kernel(member, types, friction, rng)
    return conditioned(TorquePrior(kernel, random_hyperparameters(kernel, rng)), n_samples, rng)


def random_model_without_potential(member: str) -> InverseDynamicsModel:
    """Return a model whose energy kernel has no potential, without friction."""
    rng = np.random.default_rng(0)
    own = random_kernel(member, TYPES, False, rng)
    kernel = replace(own, energy=without_potential(own.energy))
    return conditioned(TorquePrior(kernel, random_hyperparameters(kernel, rng)), 7, rng)


def random_model_without_gravity() -> InverseDynamicsModel:
    """Return an arm of torques that leave gravity out."""
    arm = random_arm(TYPES, np.random.default_rng(3))
    return of_arm(replace(arm, chain=arm.chain._replace(gravity=np.zeros(3))), TYPES)


def with_noise(model: InverseDynamicsModel, variance: float) -> InverseDynamicsModel:
    """Condition the model's prior on the same motions, with a noise variance for all joints."""
    at = process_of(model).prior.hyperparameters
    noise = np.full_like(at.noise_variance, variance)
    prior = TorquePrior(process_of(model).prior.kernel, replace(at, noise_variance=noise))
    return conditioned(prior, model.n_samples, np.random.default_rng(1))


def conditioned(
    prior: TorquePrior, n_samples: int, rng: np.random.Generator
) -> InverseDynamicsModel:
    n = prior.kernel.energy.n_joints
    motion = np.stack(random_states(n_samples, n, rng))
    states = prior.kernel.states(*motion)
    tau: Array = rng.normal(size=(n_samples, n))
    alpha = np.linalg.solve(prior.noisy_gram(states), tau.ravel()).reshape(tau.shape)
    return InverseDynamicsModel(
        joint_names=tuple(f'joint_{i + 1}' for i in range(n)),
        joint_types=prior.kernel.basis.joint_types,
        process=TorquePosterior(prior, states, tau, alpha, inflation=1.7),
        potential_reference=rng.normal(size=n),
        training_range=(motion.min(axis=1), motion.max(axis=1)),
        largest_torque=np.ones(n),
        n_samples=n_samples,
        effort_calibrations=(EffortCalibration(0.5 + rng.random(n), rng.normal(size=n)),),
    )


def of_arm(
    arm: ArmPosterior, types: tuple[str, ...], residual_gp: ResidualGP | None = None
) -> InverseDynamicsModel:
    n = len(types)
    rng = np.random.default_rng(2)
    return InverseDynamicsModel(
        joint_names=tuple(f'joint_{i + 1}' for i in range(n)),
        joint_types=types,
        potential_reference=rng.normal(size=n),
        training_range=(-np.ones((3, n)), np.ones((3, n))),
        largest_torque=np.ones(n),
        n_samples=100,
        effort_calibrations=(EffortCalibration(0.5 + rng.random(n), rng.normal(size=n)),),
        arm=arm,
        residual_gp=residual_gp,
        known_states=random_known_states(n, rng),
    )


def random_known_states(n: int, rng: np.random.Generator) -> KnownStates:
    states = stored_states(rng.normal(size=(6, 3 * n)))
    return KnownStates(states, 0.5 + rng.random(3 * n), 0.5 + rng.random())


def random_arm(types: tuple[str, ...], rng: np.random.Generator) -> ArmPosterior:
    """Return an arm whose joints are anywhere, the last coupled, of bodies that exist."""
    n = len(types)
    coupling = Coupling(n - 1, n - 2, -0.7)
    plain = plain_friction(n, (0.1 + rng.random(n)).tolist()).terms
    load = DriveTerm(Drive.of_joint(0), load_coulomb(0.2))
    coupled = DriveTerm(Drive((n - 1, 0), (1.0, -0.5)), viscous())
    effort = DriveTerm(Drive((n - 1, 0), (1.0, 0.0), (0.0, 1.0)), load_torque())
    basis = FrictionBasis(n, (*plain, load, coupled, effort))
    friction = FrictionModel(basis, rng.random(basis.size))
    root = 0.1 * rng.normal(size=(17 * n + basis.size, 5))
    return ArmPosterior(
        chain=random_chain(types, rng)._replace(couplings=rows_of((coupling,) * (n > 1))),
        links=np.stack([random_body(rng) for _ in types]),
        friction=friction,
        noise=TorqueNoise(*(0.1 + rng.random((5, n)))),
        covariance_root=root.astype(np.float32).astype(np.float64),  # as in a file
    )


def torque_of_processes(residual_gp: ResidualGP, q: Array, dq: Array, ddq: Array) -> Array:
    """Return the posterior mean as it is defined, shape (N, n)."""
    z = residual_gp.inputs(q, dq, ddq)
    out = np.sum(residual_gp.inputs.friction(dq) * residual_gp.friction, axis=2)
    for joint in np.flatnonzero(residual_gp.joints):
        cross = correlation(z, residual_gp.x, residual_gp.lengths[joint])
        out[:, joint] += cross @ residual_gp.alpha[:, joint]
    return np.asarray(out)


def random_residual_gp(types: tuple[str, ...], rng: np.random.Generator) -> ResidualGP:
    """Return processes beside the first joint and in place of the last."""
    n, own = len(types), np.zeros(len(types), dtype=bool)
    own[[0, -1]] = True
    q, dq, ddq = random_states(9, n, rng)
    inputs = Inputs.of(np.array([kind == R for kind in types]), q, dq, ddq)
    replaces = np.arange(n) == n - 1
    return ResidualGP(
        inputs=inputs,
        x=stored_inputs(inputs(q, dq, ddq)),
        lengths=rng.uniform(2.0, 6.0, inputs.scale.size) * own[:, None],
        noise=np.where(own, 0.1, 0.0),
        variance=np.where(own, 2.0, 0.0),
        left_out_std=np.where(own, 0.3, 0.0),
        replaces=replaces,
        alpha=stored_weights(rng.normal(size=(9, n)) * own),
        friction=rng.normal(size=(n, 3)) * replaces[:, None],
    )
