"""Efforts that are no torques, or not of the joints named: each is diagnosed with its remedy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from identification.drives import recording
import numpy as np
import pytest

from benchmarks._arms import RandomArm
from lip_id_ros.dataset import Dataset
from lip_id_ros.health.effort_meaning import diagnose_effort

pytestmark = pytest.mark.slow

REMEDIES = {
    'effort_without_gravity': 'gravity_compensated',
    'effort_sign': 'negative value in recording.effort_scale',
    'joint_order_by_torque': 'order a, b, c,',
    'effort_scale': 'motor constant times gear ratio',
}


def without_gravity(arm: RandomArm, data: Dataset) -> Dataset:
    still = np.zeros_like(data.q)
    return replace(data, tau=data.tau - arm.torque(data.q, still, still))


def scaled(*factors: float) -> Callable[[RandomArm, Dataset], Dataset]:
    return lambda _, data: replace(data, tau=data.tau * factors)


def in_order(*names: str) -> Callable[[RandomArm, Dataset], Dataset]:
    return lambda _, data: data.with_joints(names)


@pytest.mark.parametrize(
    ('fault', 'code'),
    [
        (without_gravity, 'effort_without_gravity'),
        (scaled(1.0, 1.0, -1.0), 'effort_sign'),
        (scaled(-1.0, -1.0, -1.0), 'effort_sign'),
        (in_order('a', 'c', 'b'), 'joint_order_by_torque'),
        (in_order('c', 'b', 'a'), 'joint_order_by_torque'),
        (scaled(0.1, 0.03, 0.055), 'effort_scale'),
    ],
)
def test_diagnosed_with_the_remedy(
    fault: Callable[[RandomArm, Dataset], Dataset], code: str
) -> None:
    (finding,) = diagnose_effort(fault(*recording(0, [])))
    assert finding.code == code
    assert REMEDIES[finding.code] in finding.text
    assert finding.text.endswith('.')
    assert finding.text.count('%') == 2


@pytest.mark.parametrize('seed', [0, 1])
def test_no_false_alarm(seed: int) -> None:
    _, dataset = recording(seed, [])
    assert diagnose_effort(dataset) == ()


def test_gravity_that_is_marked_as_taken_out() -> None:
    without = without_gravity(*recording(0, []))
    assert diagnose_effort(replace(without, gravity_compensated=True)) == ()


def test_scales_are_those_that_were_put_in() -> None:
    _, dataset = recording(0, [])
    scale = np.array([0.5, 1.0, 2.0])
    (finding,) = diagnose_effort(replace(dataset, tau=dataset.tau * scale))
    written = finding.text.split('[')[1].split(']')[0]
    np.testing.assert_allclose([float(x) for x in written.split(',')], 1.0 / scale, rtol=0.05)


def test_positions_in_revolutions_are_found_by_links() -> None:
    _, dataset = recording(0, [])
    turns = {name: getattr(dataset, name) / (2.0 * np.pi) for name in ('q', 'dq', 'ddq')}
    (finding,) = diagnose_effort(replace(dataset, **turns))
    assert finding.code == 'position_revolutions'
    assert finding.text.endswith('publish positions in rad.')
