"""Gradients of weighted torques of unit parameters against differences."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_body.arms import ARMS, random_chain

from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.couplings import Coupling, rows_of
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.regressor_pullback import regressor_pullback

H = 1e-6


@pytest.mark.parametrize(
    ('arm', 'couplings'),
    [
        *((arm, ()) for arm in ARMS),
        ('RPRPRR', ((2, 1, -0.7), (5, 2, 0.5))),
        ('PRP', ((0, 1, 0.3),)),
    ],
)
@pytest.mark.parametrize('seed', range(3))
def test_gradients_are_those_of_differences(
    arm: str, couplings: tuple[tuple[int, int, float], ...], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    chain, n = random_chain(arm, rng), len(arm)
    chain = chain._replace(
        rotations=np.ascontiguousarray(chain.rotations),
        translations=np.ascontiguousarray(chain.translations),
        couplings=rows_of([Coupling(*each) for each in couplings]),
    )
    states = rng.standard_normal((3, 6, n))
    weights = rng.standard_normal((6, n, LINK_PARAMETERS * n))
    found = regressor_pullback(chain, weights, *states)
    for which in range(3):
        for joint in range(n):
            ends = []
            for sign in (1.0, -1.0):
                moved = states.copy()
                moved[which, :, joint] += sign * H
                ends.append(np.sum(weights * torque_regressor(chain, *moved), axis=(1, 2)))
            slope = (ends[0] - ends[1]) / (2.0 * H)
            np.testing.assert_allclose(found[which, :, joint], slope, rtol=1e-6, atol=1e-6)
