"""Arms to export: the simulated Panda, prismatic ones, with friction of all kinds."""

from __future__ import annotations

import numpy as np
from rigid_body.arms import links_of, random_bodies, random_chain

from lip_id_ros.arrays import Array
from lip_id_ros.export.arm import ArmDescription, JointRanges
from lip_id_ros.friction.basis import FrictionBasis, plain_friction
from lip_id_ros.friction.conservative_terms import (
    lever_spring,
    position_curve,
    ripple,
    spring,
    velocity_curve,
)
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.friction.terms import (
    asymmetric,
    coulomb,
    dahl,
    lag,
    load_coulomb,
    load_torque,
    load_viscous,
    position_coulomb,
    presliding,
    quadratic,
    saturating,
    shared_friction,
    stribeck,
    Term,
)
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.model.effort_calibration import EffortCalibration
from lip_id_ros.model.residual_gp import Inputs, ResidualGP
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.couplings import Coupling, rows_of
from lip_id_ros.simulation.arm import panda_urdf

COUPLED = 'coupled'

EXTRA: tuple[Term, ...] = (
    stribeck(0.05),
    saturating(0.05),
    quadratic(),
    load_coulomb(0.05),
    load_viscous(),
    presliding(0.05, 3.0),
    lag(),
    asymmetric(0.1),
    position_coulomb(0.03),
    ripple(2),
    spring(),
    lever_spring(0.6, 0.4),
    position_curve(-1.0, 2.0, 5),
    velocity_curve(-2.0, 1.0, 4),
    dahl(0.05, 1e-3),
    load_torque(),
    shared_friction(0.1),
)


def every_friction(n: int, rng: np.random.Generator) -> FrictionModel:
    """Give every joint plain friction, and one joint or another every other term."""
    widths = rng.uniform(0.02, 0.1, n)
    terms = plain_friction(n, widths.tolist()).terms
    drives = [Drive.of_joint(k % n) for k in range(len(EXTRA))]
    if n > 1:
        drives[-2:] = [Drive.transmitted(n - 1, to=n - 2)] * 2
    terms += tuple(DriveTerm(*each) for each in zip(drives, EXTRA, strict=True))
    if n > 1:
        terms += (DriveTerm(Drive((n - 1, n - 2), (1.0, -0.5)), coulomb(0.04)),)
    basis = FrictionBasis(n, terms, 0.05 if n % 2 else 0.0)
    return FrictionModel(basis, rng.uniform(0.1, 1.0, basis.size))


def describe(name: str, chain: Chain, links: Array, seed: int = 0) -> ArmDescription:
    n, rng = len(links), np.random.default_rng(seed)
    reach = np.where(chain.prismatic, 0.4, 2.5)
    return ArmDescription(
        name=name,
        joint_names=tuple(f'joint_{i + 1}' for i in range(n)),
        chain=chain,
        links=links,
        friction=every_friction(n, rng),
        ranges=JointRanges(-reach, 0.9 * reach, reach, 4.0 * reach, np.full(n, 80.0)),
        potential_reference=0.1 * np.arange(n, dtype=np.float64),
        remarks=('A remark with -- and */ in it.',),
    ).in_standard_frames()


def panda() -> ArmDescription:
    import pinocchio

    model = pinocchio.buildModelFromXML(panda_urdf().read_text(encoding='utf-8'))
    arm = pinocchio.buildReducedModel(model, [8, 9], pinocchio.neutral(model))
    arm.armature = np.linspace(0.02, 0.2, 7)
    return describe('panda', *links_of(arm))


def random_arm(kinds: str, seed: int = 0) -> ArmDescription:
    rng = np.random.default_rng(seed)
    chain = random_chain(kinds, rng)
    return describe(f'arm_{kinds}', chain, random_bodies(len(kinds), rng), seed)


def coupled_arm() -> ArmDescription:
    """Return an arm some of whose reported positions are coupled, one of them twice."""
    rng = np.random.default_rng(4)
    couplings = Coupling(2, 1, -1.0), Coupling(3, 2, 0.5), Coupling(3, 0, 0.2)
    chain = random_chain('RRRR', rng)._replace(couplings=rows_of(couplings))
    return describe(COUPLED, chain, random_bodies(4, rng))


def arm_of(name: str) -> ArmDescription:
    if name == COUPLED:
        return coupled_arm()
    return panda() if name == 'panda' else random_arm(name)


def model_of(arm: ArmDescription) -> InverseDynamicsModel:
    n = arm.n_joints
    coordinates = 17 * n + arm.friction.basis.size
    low = np.stack([arm.ranges.q_min, -arm.ranges.dq_max, -arm.ranges.ddq_max])
    high = np.stack([arm.ranges.q_max, arm.ranges.dq_max, arm.ranges.ddq_max])
    return InverseDynamicsModel(
        joint_names=arm.joint_names,
        joint_types=tuple('prismatic' if x else 'revolute' for x in arm.chain.prismatic),
        potential_reference=arm.potential_reference,
        training_range=(low, high),
        n_samples=100,
        largest_torque=arm.ranges.tau_max,
        effort_calibrations=(EffortCalibration.identity(n),),
        arm=ArmPosterior(
            arm.chain,
            arm.links,
            arm.friction,
            TorqueNoise.constant(np.full(n, 0.05)),
            1e-9 * np.eye(coordinates),
        ),
    )


def residual_gp_of(arm: ArmDescription) -> ResidualGP:
    """Return a process beside the first joint's links, and one in place of the second's."""
    n, rng = arm.n_joints, np.random.default_rng(0)
    states = rng.standard_normal((3, 5, n))
    inputs = Inputs.of(~arm.chain.prismatic, *states)
    has = np.arange(n) < 2
    return ResidualGP(
        inputs=inputs,
        x=inputs(*states),
        lengths=np.where(has, 4.0, 0.0)[:, None] * np.ones_like(inputs.scale),
        noise=np.full(n, 0.1),
        variance=np.ones(n),
        left_out_std=np.full(n, 0.1),
        replaces=np.arange(n) == 1,
        alpha=has * rng.standard_normal((5, n)),
        friction=np.zeros((n, 3)),
    )
