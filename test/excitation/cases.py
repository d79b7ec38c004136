"""Limits and arms to design motions for."""

from __future__ import annotations

from hypothesis import strategies as st
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import LimitedMotions

SEEDS = st.integers(0, 2**32 - 1)

ARM = """<robot name="arm">
  <link name="base"/>
  <joint name="turn" type="continuous">
    <parent link="base"/><child link="a"/><axis xyz="0 0 1"/><limit velocity="2" effort="30"/>
  </joint>
  <link name="a"/>
  <joint name="lift" type="revolute">
    <parent link="a"/><child link="b"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" velocity="1" effort="20"/>
  </joint>
  <link name="b"/>
  <joint name="slide" type="prismatic">
    <parent link="b"/><child link="c"/><origin xyz="0.2 0 0"/><axis xyz="1 0 0"/>
    <limit lower="0.1" upper="0.5" velocity="0.4" effort="50"/>
  </joint>
  <link name="c"/>
</robot>
"""


def random_limits(rng: np.random.Generator, n_joints: int) -> JointLimits:
    """Draw limits of which now one and now another comes first."""
    lower = rng.uniform(-3.0, 1.0, n_joints)
    return JointLimits(
        tuple(f'joint_{i}' for i in range(n_joints)),
        lower,
        lower + 10.0 ** rng.uniform(-2.0, 1.0, n_joints),
        *10.0 ** rng.uniform([[-1.0], [-1.0], [-1.0]], [[1.0], [1.5], [2.5]], (3, n_joints)),
    )


def random_posture(rng: np.random.Generator, limits: JointLimits) -> Array:
    share = rng.beta(0.5, 0.5, len(limits.lower))
    return limits.lower + np.clip(share, 0.01, 0.99) * (limits.upper - limits.lower)


def random_motions(rng: np.random.Generator) -> tuple[JointLimits, LimitedMotions]:
    limits = random_limits(rng, int(rng.integers(1, 8)))
    duration, harmonics = rng.uniform(0.2, 2.0), int(rng.integers(2, 13))
    posture = random_posture(rng, limits)
    return limits, LimitedMotions(limits, posture, duration, harmonics)
