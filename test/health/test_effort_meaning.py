"""Efforts that are no torques, or not of the joints named: each is diagnosed with its remedy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks._drives import Fault, FAULTS, faulty, nothing, recording
from lip_id_ros.health.effort_meaning import diagnose_effort

pytestmark = pytest.mark.slow

REMEDIES = {
    'effort_without_gravity': 'gravity_compensated',
    'effort_sign': 'negative value in recording.effort_scale',
    'joint_order_by_torque': 'order a, b, c,',
    'effort_scale': 'motor constant times gear ratio',
}


@pytest.mark.parametrize('fault', [each for each in FAULTS if each is not nothing])
def test_diagnosed_with_the_remedy(fault: Fault) -> None:
    """`python -m benchmarks selections` counts more seeds."""
    (finding,) = diagnose_effort(faulty(fault, 0))
    assert (finding.code,) == FAULTS[fault]
    assert REMEDIES[finding.code] in finding.text
    assert finding.text.endswith('.')
    assert finding.text.count('%') == 2


@pytest.mark.parametrize('seed', [0, 1])
def test_no_false_alarm(seed: int) -> None:
    _, dataset = recording(seed, [])
    assert diagnose_effort(dataset) == ()


def test_gravity_that_is_marked_as_taken_out() -> None:
    arm, dataset = recording(0, [])
    tau = dataset.tau - arm.gravity(dataset.q)
    assert diagnose_effort(replace(dataset, tau=tau, gravity_compensated=True)) == ()


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
