"""The tracking experiment behind a real controller: its reference, its models, a short run."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from programs import installed
import pytest
from ros_domain import free_domain

from benchmarks import track_controller
from benchmarks.__main__ import main

pytestmark = pytest.mark.slow

pytest.importorskip('pinocchio', reason='the simulated arm needs pinocchio')


@pytest.mark.ros
@pytest.mark.ros2_control
def test_an_arm_behind_a_controller_is_learned_and_tracked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if installed('controller_manager', 'ros2_control_node') is None:
        pytest.skip('needs a controller manager; with g++ make setup compiles it')
    figures = tmp_path / 'figures.json'
    arguments = ['--horizon', '4', '--amplitudes', '0.5', '--json', str(figures)]
    with free_domain() as domain:
        monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
        assert main(['track_controller', *arguments]) == 0
    rows = {row['feedforward']: row for row in json.loads(figures.read_text())}
    nominal, learned = (
        np.array(rows[name]['feedback_mean_square'])
        for name in (track_controller.NOMINAL, track_controller.LEARNED)
    )
    assert np.exp(np.log(learned / nominal).mean()) < 0.3


def test_the_reference_is_the_papers_and_begins_and_ends_at_rest() -> None:
    amplitude, horizon, ease = 0.6, 10.0, track_controller.EASE_S
    t, (q, dq, ddq) = track_controller.reference(amplitude, horizon)
    since = t - ease
    within = (since >= 0.0) & (since <= horizon)
    swing = amplitude / horizon * since * np.cos(np.pi * since)
    expected = track_controller.POSTURE + swing[:, None]
    np.testing.assert_allclose(q[within], expected[within], atol=1e-12)
    np.testing.assert_allclose(dq[-1], 0.0, atol=1e-12)
    np.testing.assert_allclose(dq[0], 0.0, atol=1e-3)
    np.testing.assert_allclose(np.gradient(q, t, axis=0)[1:-1], dq[1:-1], atol=2e-3)
    np.testing.assert_allclose(np.gradient(dq, t, axis=0)[1:-1], ddq[1:-1], atol=0.2)


def test_a_nominal_model_is_wrong_in_its_masses_and_knows_no_friction() -> None:
    known, arm = track_controller.feedforwards(0), track_controller.true_arm()
    q, still = track_controller.POSTURE[None], np.zeros((1, 7))
    moving = np.full((1, 7), 0.5)
    true = arm.torque(q, still, still)
    weight = known[track_controller.KDL](q, still, still)
    np.testing.assert_allclose(weight, true, rtol=1e-3, atol=1e-9)  # of 9.81 m/s^2
    off = np.abs(known[track_controller.NOMINAL](q, still, still) - true)
    assert 0.3 < off.max() < 10.0
    rubbing = known[track_controller.INFORMED](q, moving, still)
    rubbing -= known[track_controller.NOMINAL](q, moving, still)
    sign = np.tanh(0.5 / track_controller.SIGN_WIDTH)
    np.testing.assert_allclose(rubbing[0], track_controller.FRICTION * (0.5 + sign))
