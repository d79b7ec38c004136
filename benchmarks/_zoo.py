"""Serial arms of many robots, from their URDFs, and simulated recordings of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
import xml.etree.ElementTree as ET
from zlib import crc32

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.description.urdf import KINDS, parse_description, parsed
from lip_id_ros.errors import DataError
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)
from lip_id_ros.simulation.datasets import make_dataset
from lip_id_ros.simulation.trajectories import MotionLimits, SinusoidTrajectory

SECONDS, RATE_HZ = 60.0, 25.0
FASTEST_HZ, PERIOD_S = 0.65, 8.0
MOTIONS = ('random', 'periodic')
NOISE = 0.01
"""Standard deviation, as a share of that of the joint's torque."""

REACH, SHARE = 2.5, 0.9
"""A joint moves at most so far from its middle [rad or m], and over this share of its range."""
VELOCITY, ACCELERATION = (2.0, 0.3), (10.0, 1.0)
"""Upper bounds of revolute joints [rad/s, rad/s^2], and of slides [m/s, m/s^2]."""

LEAST_ROTOR = 0.01
"""Of the largest inertia that a revolute joint moves: small motors have small gears, not none."""


@dataclass(frozen=True)
class ZooArm:
    """A URDF below the folder of the robots, and the first and last joint of the arm in it."""

    urdf: str
    first: str
    last: str


TABLE = """
UR3 | ur_description/urdf/ur3_robot | shoulder_pan_joint | wrist_3_joint
UR5 | ur_description/urdf/ur5_robot | shoulder_pan_joint | wrist_3_joint
UR10 | ur_description/urdf/ur10_robot | shoulder_pan_joint | wrist_3_joint
Kinova | kinova_description/robots/kinova | j2s6s200_joint_1 | j2s6s200_joint_6
xArm7 | xarm_description/urdf/xarm7 | joint1 | joint7
Z1 | z1_description/urdf/z1 | joint1 | joint6
SO-101 | so_arm_description/urdf/so101 | shoulder_pan | wrist_roll
TALOS | talos_data/robots/talos_reduced | arm_left_1_joint | arm_left_7_joint
Baxter | baxter_description/urdf/baxter | left_s0 | left_w2
TIAGo Pro | tiago_pro_description/robots/tiago_pro | arm_left_1_joint | arm_left_7_joint
PR2 | pr2_description/urdf/pr2 | l_shoulder_pan_joint | l_wrist_roll_joint
iCub | icub_description/robots/icub_reduced | l_shoulder_pitch | l_wrist_yaw
Romeo | romeo_description/urdf/romeo_small | LShoulderPitch | LWristPitch
CENTAURO | centauro_description/urdf/centauro | j_arm1_1 | j_arm1_6
Alex | alex_description/urdf/alex_nub_hands | LeftShoulderPitch | LeftGripperYaw
G1, leg | g1_description/urdf/g1_29dof_rev_1_0 | left_hip_pitch_joint | left_ankle_roll_joint
Allegro, finger | allegro_hand_description/urdf/allegro_right_hand | joint_0.0 | joint_3.0
Finger Edu | finger_edu_description/robots/finger_edu |\
 finger_base_to_upper_joint | finger_middle_to_lower_joint
TIAGo, torso | tiago_description/robots/tiago_no_hand | torso_lift_joint | arm_7_joint
"""
ROWS = [row.split(' | ') for row in TABLE.strip().splitlines()]
ZOO = {name: ZooArm(f'{urdf}.urdf', first, last) for name, urdf, first, last in ROWS}
"""By the names that the page has for them."""


@dataclass(frozen=True)
class SerialArm:
    """The joints of an arm from base to tip, as its URDF has them, and how they may move."""

    description: RobotDescription
    limits: MotionLimits


def load_arm(urdf: Path, first: str, last: str) -> SerialArm:
    """
    Read the joints from `first` to `last` of a URDF; all others are locked at zero.

    OSError if the file cannot be opened, DataError if it has no such arm.

    """
    text = urdf.read_text(encoding='utf-8')
    joints = _between(parsed(text, str(urdf)), first, last, urdf)
    names = [joint.get('name', '') for joint in joints]
    types = [KINDS[joint.get('type', '')] for joint in joints]
    description = parse_description(text, str(urdf), names, types)
    return SerialArm(description, _limits(joints, np.asarray(is_prismatic(types), dtype=int)))


def _between(root: ET.Element, first: str, last: str, urdf: Path) -> list[ET.Element]:
    """Return the joints that move, from one to another that it carries."""
    by_name = {joint.get('name'): joint for joint in root.findall('joint')}
    above = {_link(joint, 'child'): joint for joint in by_name.values()}
    found, joint = [], by_name.get(last)
    while joint is not None:
        if joint.get('type') in KINDS:
            found.append(joint)
        if joint.get('name') == first:
            return found[::-1]
        joint = above.get(_link(joint, 'parent'))
    raise DataError(
        f'joint {last!r} was expected to be carried by joint {first!r} in {urdf}, but it is not; '
        'name the first and the last joint of an arm.'
    )


def _link(joint: ET.Element, end: str) -> str:
    found = joint.find(end)
    return '' if found is None else found.get('link', '')


def _limits(joints: list[ET.Element], slide: Array) -> MotionLimits:
    """Return the limits of the URDF, but none that is wider than a sensible motion."""
    centre, half, velocity = np.array([_bounds(joint) for joint in joints]).T
    reach = np.minimum(SHARE * half, REACH)
    return MotionLimits(
        centre - reach,
        centre + reach,
        np.minimum(velocity, np.array(VELOCITY)[slide]),
        np.array(ACCELERATION)[slide],
    )


def _bounds(joint: ET.Element) -> tuple[float, float, float]:
    """Return middle and half of the range, and the velocity; infinite where the URDF has none."""
    limit = joint.find('limit')
    has = {} if limit is None else limit.attrib
    velocity = float(has.get('velocity', 'inf'))
    lower, upper = float(has.get('lower', 'nan')), float(has.get('upper', 'nan'))
    if joint.get('type') == 'continuous' or not lower < upper:
        return 0.0, np.inf, velocity
    return (lower + upper) / 2, (upper - lower) / 2, velocity


@dataclass(frozen=True)
class ZooFriction:
    """
    Viscous, Coulomb and Stribeck friction of every joint, all (n,).

    `width`: velocity at which the smooth sign is tanh(1). `stribeck`: speed at which stiction has
    fallen to 1/e [rad/s or m/s].

    """

    viscous: Array
    coulomb: Array
    stiction: Array
    width: Array
    stribeck: Array

    def features(self, dq: Array) -> tuple[Array, Array, Array]:
        """Return what the three coefficients multiply, each (N, n)."""
        sign = np.tanh(dq / self.width)
        return dq, sign, np.exp(-np.square(dq / self.stribeck)) * sign

    def torque(self, dq: Array) -> Array:
        """Return the torque of friction [N m or N], shape (N, n)."""
        viscous, coulomb, stiction = self.features(dq)
        return viscous * self.viscous + coulomb * self.coulomb + stiction * self.stiction


class SimulatedZooArm:
    """Rigid links of a URDF with rotors (n,) [kg m^2 or kg] and friction."""

    def __init__(self, arm: SerialArm, rotors: Array, friction: ZooFriction) -> None:
        described, self.friction = arm.description, friction
        self.joint_names, self.joint_types = described.joint_names, described.joint_types
        self._chain, links = described.chain, described.links
        links[:, -1] = rotors
        self._links = links.ravel()

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (N, n)."""
        return np.asarray(self.rigid(q, dq, ddq) + self.friction.torque(dq))

    def rigid(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques of links and rotors [N m or N], shape (N, n)."""
        return np.asarray(torque_regressor(self._chain, q, dq, ddq) @ self._links)

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Kinetic energy [J], shape (N,)."""
        return np.asarray(kinetic_regressor(self._chain, q, dq) @ self._links)

    def potential(self, q: Array) -> Array:
        """Potential energy [J], shape (N,)."""
        return np.asarray(potential_regressor(self._chain, q) @ self._links)


@dataclass(frozen=True, eq=False)
class ZooRecording:
    """A simulated minute to learn from, another motion, and the friction of both."""

    train: Dataset
    test: Dataset
    friction: ZooFriction


def recorded(arm: SerialArm, motion: str, seed: int) -> ZooRecording:
    """
    Draw drives and motions, and record them.

    `motion`: of the training data, one of `MOTIONS`. The unseen one is random, and is the same for
    both. A seed draws others for every arm.

    """
    simulated, seen, unseen, rng = drawn(arm, motion, seed)
    t = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ
    std = NOISE * simulated.inverse_dynamics(*seen.sample(t)).std(axis=0)
    train, test = (make_dataset(simulated, each, t, std, rng) for each in (seen, unseen))
    return ZooRecording(train, test, simulated.friction)


def drawn(
    arm: SerialArm, motion: str, seed: int
) -> tuple[SimulatedZooArm, SinusoidTrajectory, SinusoidTrajectory, np.random.Generator]:
    """Return the arm with its drives, the motion to learn from, the unseen one, and the rest."""
    rng = np.random.default_rng([seed, crc32(arm.description.text.encode())])
    unseen = random_motion(arm.limits, rng)
    simulated = _with_drives(arm, unseen, rng)
    seen = _motion(arm.limits, rng, PERIOD_S if motion == 'periodic' else SECONDS)
    return simulated, seen, unseen, rng


def random_motion(limits: MotionLimits, rng: np.random.Generator) -> SinusoidTrajectory:
    """Draw a motion that takes the minute before it repeats."""
    return _motion(limits, rng, SECONDS)


def _motion(limits: MotionLimits, rng: np.random.Generator, period_s: float) -> SinusoidTrajectory:
    return SinusoidTrajectory.random(limits, rng, round(FASTEST_HZ * period_s), 1.0 / period_s)


def _with_drives(
    arm: SerialArm, motion: SinusoidTrajectory, rng: np.random.Generator
) -> SimulatedZooArm:
    """Draw rotors by the inertia that each joint moves, and friction by its torque and speed."""
    n = arm.limits.n_joints
    q, dq, ddq = motion.sample(np.linspace(0.0, SECONDS, 200))
    none = ZooFriction(*np.zeros((3, n)), *np.ones((2, n)))
    bare = SimulatedZooArm(arm, np.zeros(n), none)
    moved = _inertias(bare, q)
    least = LEAST_ROTOR * moved[~is_prismatic(arm.description.joint_types)].max()
    rotors = rng.uniform(0.3, 1.0, n) * np.maximum(moved, least)
    load = _rms(SimulatedZooArm(arm, rotors, none).rigid(q, dq, ddq))
    top = arm.limits.dq_max
    coulomb = rng.uniform(0.05, 0.2, n) * load
    return SimulatedZooArm(
        arm,
        rotors,
        ZooFriction(
            viscous=rng.uniform(0.05, 0.2, n) * load / _rms(dq),
            coulomb=coulomb,
            stiction=rng.uniform(0.2, 0.6, n) * coulomb,
            width=top * np.exp(rng.uniform(np.log(0.005), np.log(0.02), n)),
            stribeck=top * np.exp(rng.uniform(np.log(0.03), np.log(0.1), n)),
        ),
    )


def _inertias(arm: SimulatedZooArm, q: Array) -> Array:
    """Return the mean of the diagonal of the inertia matrix over positions, shape (n,)."""
    rest = np.zeros_like(q)
    held = arm.rigid(q, rest, rest)
    n = q.shape[1]
    one = [arm.rigid(q, rest, rest + np.eye(n)[j])[:, j] - held[:, j] for j in range(n)]
    return np.mean(one, axis=1)


def _rms(values: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))
