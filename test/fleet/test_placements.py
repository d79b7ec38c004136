"""Placements of a fleet as they are kept for later fits."""

from __future__ import annotations

from fleet.fleets import arm_of, recording
import numpy as np
from numpy.testing import assert_array_equal

from lip_id_ros.fleet.placements import PlacedArm, SIGNALS
from lip_id_ros.identification.remainder_election import RemainderProcess


def placed() -> PlacedArm:
    arm = arm_of()
    data = recording(arm, np.zeros((2, 3)), seed=0, count=20)
    return PlacedArm(
        joint_names=data.joint_names,
        joint_types=data.joint_types,
        rotations=arm.chain.rotations,
        translations=arm.chain.translations,
        gravity=arm.chain.gravity,
        couplings=arm.chain.couplings,
        links=arm.parameters,
        friction='{}',
        noise_std=np.ones(2),
        noise_ratio=np.zeros(2),
        noise_velocity=np.ones(2),
        twists=np.full(2, np.nan),
        meets=np.zeros(2, dtype=bool),
        rigid=False,
        report='{}',
        excluded=(),
        processes=(),
        **{name: getattr(data, name) for name in SIGNALS},
        gravity_compensated=False,
    )


def test_processes_are_kept() -> None:
    process = RemainderProcess(True, np.array([0.3, 2.0]), 0.1, 0.25)
    kept = placed().with_remainder([None, process])
    first, second = PlacedArm.from_bytes(kept.to_bytes()).remainder
    assert first is None
    assert second is not None
    assert (second.replaces, second.noise, second.left_out_std) == (True, 0.1, 0.25)
    assert_array_equal(second.lengths, process.lengths)
