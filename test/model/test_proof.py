"""A model is proven where it was judged on unseen motion and was better than the mean there."""

from __future__ import annotations

from dataclasses import replace
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from model.models import random_model
import pytest

from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.model.proof import (
    LEAST_HELD_OUT_S,
    LEAST_NEW_S,
    missing_proof,
    USELESS_PERCENT,
    with_held_out,
)

MODEL = random_model(ARTICULATED)
N = MODEL.n_joints
GOOD: dict[str, Any] = {
    'motion_s': 30.0,
    'new_motion_s': 10.0,
    'unexplained_percent': [1.0] * N,
}
SHORT: dict[str, Any] = {**GOOD, 'new_motion_s': 2.13}


def of(summary: dict[str, Any]) -> InverseDynamicsModel:
    return replace(MODEL, summary=summary)


def test_a_constant_torque_needs_no_proof() -> None:
    assert missing_proof(of({**GOOD, 'unexplained_percent': [None, 1.0, 1.0]})) is None


@pytest.mark.parametrize(
    ('summary', 'sentence'),
    [
        ({}, 'its file does not say on what motion it was judged; fit again'),
        (
            SHORT,
            'its recording has 2.1 s of motion that is not repeated (at least 4 s), and no '
            'samples were held out of its fit; record more motion, or hold samples out (fit '
            '--holdout, holdout of train)',
        ),
        (
            {**GOOD, 'unexplained_percent': [1.0, 143.2, 1.0]},
            'on left-out motion it predicts hardly better than the mean of the torque at 1 of 3 '
            'joints (error in % of the variance): joint_2 (143 %); check the efforts, the order '
            'and the types of the joints with lip_id inspect of the recording, and record more '
            'motion',
        ),
    ],
)
def test_what_is_missing_is_named(summary: dict[str, Any], sentence: str) -> None:
    assert missing_proof(of(summary)) == sentence


def test_a_process_that_leaves_blocks_of_time_out_sees_repetitions() -> None:
    process = random_model('recursive')
    assert missing_proof(replace(process, summary={**GOOD, 'new_motion_s': 18.0})) is None
    for new_s, unseen in ((16.0, '2'), (10.0, '0')):
        lack = missing_proof(replace(process, summary={**GOOD, 'new_motion_s': new_s}))
        assert lack is not None
        assert lack.startswith(f'its recording has {unseen} s of motion that is not repeated')


def test_held_out_motion_proves_what_left_too_little_out() -> None:
    errors = [2.0, 3.0, math.nan]
    assert missing_proof(with_held_out(of(SHORT), errors, 3.0)) is None
    repeated = missing_proof(with_held_out(of(SHORT), errors, 0.2))
    assert repeated is not None
    assert 'its held-out samples have 0.2 s of motion that its training lacks' in repeated


def test_every_motion_on_which_it_is_useless_is_named() -> None:
    useless = missing_proof(with_held_out(of(GOOD), [2.0, 80.1, 300.0], 3.0))
    assert useless is not None
    assert useless.startswith('on held-out motion it predicts hardly better than the mean')
    assert 'at 2 of 3 joints (error in % of the variance): joint_2 (80.1 %), joint_3' in useless
    both = of({**GOOD, 'unexplained_percent': [math.nan, 79.9, None]})
    lack = missing_proof(with_held_out(both, [2.0, 82.0, 3.0], 3.0))
    assert lack is not None
    left_out, held_out = lack.split(', and on held-out motion')
    assert left_out.endswith(': joint_1 (nan %)')
    assert ': joint_2 (82 %); check' in held_out


@given(
    st.floats(0.0, 60.0),
    st.lists(st.floats(0.0, 300.0), min_size=N, max_size=N),
    st.none() | st.floats(0.0, 60.0),
)
def test_proven_is_seen_enough_and_better_everywhere(
    new_s: float, percent: list[float], held_out_s: float | None
) -> None:
    model = of({**GOOD, 'new_motion_s': new_s, 'unexplained_percent': percent})
    enough = new_s >= LEAST_NEW_S
    if held_out_s is not None:
        model = with_held_out(model, percent, held_out_s)
        enough = enough or round(held_out_s, 3) >= LEAST_HELD_OUT_S
    better = all(x < USELESS_PERCENT for x in percent)
    assert (missing_proof(model) is None) == (enough and better)
