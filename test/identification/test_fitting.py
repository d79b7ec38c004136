"""Data sets that a fit refuses or doubts, with what to do about it."""

from __future__ import annotations

from dataclasses import replace

from identification.drives import recording
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation import fit_cautions
from lip_id_ros.identification.effort_scale import (
    EffortScale,
    from_revolutions,
    may_be_revolutions,
    TURN,
)
from lip_id_ros.identification.fitting import fit
from lip_id_ros.identification.friction_candidates import RISE_PERIODS, rise_time


def recorded(still: list[int], n_joints: int = 3) -> Dataset:
    q, dq, ddq, tau = np.random.default_rng(0).standard_normal((4, 20, n_joints))
    tau[:, still] = 0.0
    return Dataset.from_arrays(q, dq, ddq, tau, joint_names=('lift', 'elbow', 'finger')[:n_joints])


def test_every_joint_whose_effort_never_changes_is_named_with_the_option() -> None:
    with pytest.raises(DataError, match=r"those of 'lift', 'finger' are .*: --joints elbow, or"):
        fit(recorded([0, 2]))


def test_where_no_effort_changes_there_is_nothing_to_choose() -> None:
    with pytest.raises(DataError, match=r'or did not move[.]'):
        fit(recorded([0, 1, 2]))


ONES = np.ones(4)


@pytest.mark.parametrize(
    ('residual', 'explains'),
    [
        ([0.03, 0.03, 0.03, 0.03], True),
        ([0.01, 0.01, 0.01, 0.15], True),
        ([0.1, 0.1, 0.1, 0.1], False),
        ([0.01, 0.01, 0.01, 0.5], False),
    ],
)
def test_efforts_are_explained_together(residual: list[float], *, explains: bool) -> None:
    scale = EffortScale(ONES, np.array(residual), 0.1 * ONES, ONES, ONES)
    assert scale.explains == explains


@pytest.mark.parametrize(
    ('cutoffs', 'expected'),
    [
        ([], 0.0),
        ([4.0], RISE_PERIODS / 4.0),
        ([2.0, 8.0], RISE_PERIODS / 8.0),
        ([0.0], 0.0),
        ([np.nan, -1.0], 0.0),
    ],
)
def test_rise_time(cutoffs: list[float], expected: float) -> None:
    """Of several cut-offs that of the highest, which changes friction least."""
    _, dataset = recording(0, [])
    sources = [{'preprocessing': {'cutoff_hz': cutoff}} for cutoff in cutoffs]
    assert rise_time(replace(dataset, provenance={'sources': sources})) == expected


def with_positions_times(dataset: Dataset, factor: float) -> Dataset:
    q, dq, ddq = (factor * each for each in (dataset.q, dataset.dq, dataset.ddq))
    return replace(dataset, q=q, dq=dq, ddq=ddq)


@pytest.mark.slow
def test_positions_in_revolutions_are_a_caution() -> None:
    _, dataset = recording(0, [])
    cautions = fit_cautions(fit(with_positions_times(dataset, 1.0 / TURN)))
    assert sum('in revolutions: read so, they leave' in each for each in cautions) == 1


@pytest.mark.slow
def test_positions_in_rad_are_none_with_noise_that_links_cannot_explain() -> None:
    """The range is one that revolutions could have, and links explain the torques badly."""
    arm, dataset = recording(0, [])
    small = with_positions_times(dataset, 0.25)
    tau = arm.torque(small.q, small.dq, small.ddq)
    tau += 0.2 * tau.std(axis=0) * dataset.tau / dataset.tau.std(axis=0)
    assert may_be_revolutions(small)
    model = fit(replace(small, tau=tau))
    assert max(model.summary['unexplained_left_out']) > 0.0025
    assert not any('revolutions' in each for each in model.summary['suspicions'])


@pytest.mark.slow
def test_prismatic_joints_stay_as_they_are() -> None:
    _, dataset = recording(0, [])
    mixed = replace(dataset, joint_types=('prismatic', 'revolute', 'revolute'))
    turned = from_revolutions(mixed)
    assert (turned.q[:, 0] == dataset.q[:, 0]).all()
    assert turned.dq[:, 1:] == pytest.approx(TURN * dataset.dq[:, 1:])
