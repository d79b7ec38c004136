"""Arms with coupled positions, and the rows of their table."""

from __future__ import annotations

import numpy as np

from benchmarks._coupled import ARMS, coupled_arm, NOISE, recorded
from benchmarks.couplings import line


def test_a_seed_has_the_same_links_whatever_the_couplings() -> None:
    arms = [coupled_arm(couplings, 3) for couplings in ARMS.values()]
    for arm, couplings in zip(arms, ARMS.values(), strict=True):
        np.testing.assert_array_equal(arm.links, arms[0].links)
        np.testing.assert_array_equal(arm.chain.rotations, arms[0].chain.rotations)
        assert len(arm.chain.couplings) == len(couplings)


def test_motions_repeat_or_do_not_and_torques_have_noise() -> None:
    for periodic in (False, True):
        train, test = recorded(coupled_arm(ARMS['wrist'], 0), periodic, 0)
        assert np.allclose(train.q[:480], train.q[240:720]) == periodic
        assert train.tau_noiseless is not None
        noise = (train.tau - train.tau_noiseless).std(axis=0)
        np.testing.assert_allclose(noise, NOISE * test.tau.std(axis=0), rtol=0.1)


def test_a_line_counts_what_was_found_as_it_is() -> None:
    wrist = [list(each) for each in ARMS['wrist']]
    rows = [
        {'found': found, 'nmse': [0.01, 0.04], 'cpu_s': 10.0} for found in (wrist, [], wrist * 2)
    ]
    assert line('wrist', 'random', rows) == '| wrist | random | 1 of 3 | 0.02 | 10 |'
