"""Sound recordings of a simulated Panda with friction, and ways to break them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.health import evidence_of, examine, Finding
from lip_id_ros.recording import JointSamples

RATE = 100.0
NAMES = tuple(f'arm_joint{number}' for number in range(1, 8))
COULOMB = np.array([2.0, 2.0, 1.5, 1.5, 0.8, 0.8, 0.8])
VISCOUS = np.array([2.0, 2.0, 1.5, 1.5, 0.5, 0.5, 0.5])


@cache
def sound(
    seed: int = 0, friction: float = 1.0, seconds: float = 40.0, reach: float = 1.0
) -> JointSamples:
    """Return a recording with the noise of a good driver; `reach` shrinks the motion."""
    pytest.importorskip('pinocchio', reason='needs pinocchio')
    from benchmarks._arms import FrictionalArm, JointFriction
    from lip_id_ros.simulation import panda, SinusoidTrajectory
    from lip_id_ros.simulation.arm import MOTION

    rng = np.random.default_rng(seed)
    arm = FrictionalArm(panda(7), JointFriction(friction * VISCOUS, friction * COULOMB))
    t = np.arange(round(seconds * RATE)) / RATE
    q, dq, ddq = (reach * x for x in SinusoidTrajectory.random(MOTION, rng).sample(t))
    q += 0.5 * (1.0 - reach) * (MOTION.q_min + MOTION.q_max)
    return JointSamples(
        t=t,
        position=q + 1e-5 * rng.standard_normal(q.shape),
        velocity=dq + 2e-3 * rng.standard_normal(q.shape),
        effort=arm.inverse_dynamics(q, dq, ddq) + 0.05 * rng.standard_normal(q.shape),
        joint_names=NAMES,
        source='arm.mcap',
    )


def codes(samples: JointSamples) -> set[str]:
    return {finding.code for finding in found(samples)}


def found(samples: JointSamples) -> tuple[Finding, ...]:
    return examine(evidence_of(samples))


def column(samples: JointSamples, signal: str, joint: int, values: Any) -> JointSamples:
    changed = getattr(samples, signal).copy()
    changed[:, joint] = values
    return replace(samples, **{signal: changed})


def rows(samples: JointSamples, keep: Any) -> JointSamples:
    return replace(
        samples,
        t=samples.t[keep],
        position=samples.position[keep],
        velocity=samples.velocity[keep],
        effort=samples.effort[keep],
    )


def delayed(samples: JointSamples, signal: str, seconds: float) -> JointSamples:
    late = [np.interp(samples.t - seconds, samples.t, c) for c in getattr(samples, signal).T]
    changed: dict[str, Any] = {signal: np.column_stack(late)}
    return replace(samples, **changed)


def moved(samples: JointSamples, joint: int, q: Array, dq: Array) -> JointSamples:
    """Let one joint move otherwise; its effort stays what it was."""
    return column(column(samples, 'position', joint, q), 'velocity', joint, dq)
