"""A fit to positions in revolutions says so, and one to a small motion in rad does not."""

from __future__ import annotations

from dataclasses import replace

from identification.drives import recording
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import fit_cautions
from lip_id_ros.identification import fit
from lip_id_ros.identification.effort_scale import from_revolutions, may_be_revolutions, TURN

pytestmark = pytest.mark.slow


def with_positions_times(dataset: Dataset, factor: float) -> Dataset:
    q, dq, ddq = (factor * each for each in (dataset.q, dataset.dq, dataset.ddq))
    return replace(dataset, q=q, dq=dq, ddq=ddq)


def test_positions_in_revolutions_are_a_caution() -> None:
    _, dataset = recording(0, [])
    cautions = fit_cautions(fit(with_positions_times(dataset, 1.0 / TURN)))
    assert sum('in revolutions: read so, they leave' in each for each in cautions) == 1


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


def test_prismatic_joints_stay_as_they_are() -> None:
    _, dataset = recording(0, [])
    mixed = replace(dataset, joint_types=('prismatic', 'revolute', 'revolute'))
    turned = from_revolutions(mixed)
    assert (turned.q[:, 0] == dataset.q[:, 0]).all()
    assert turned.dq[:, 1:] == pytest.approx(TURN * dataset.dq[:, 1:])
