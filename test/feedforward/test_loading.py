"""Models: served as they are, or refused with the reason."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from serving.models import random_model

from lip_id_ros.errors import ConfigError, ModelError
from lip_id_ros.feedforward.loading import load_arm, load_successor, require_rules
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.serving import Predictor

MODEL = random_model('recursive')
JOINTS = MODEL.joint_names


@pytest.fixture
def settings(tmp_path: Path) -> ServeSettings:
    path = str(tmp_path / 'model.npz')
    MODEL.save(path)
    return ServeSettings(model_path=path)


def test_an_arm_answers_as_its_model(settings: ServeSettings) -> None:
    arm = load_arm(settings, JOINTS[::-1])
    state = np.random.default_rng(0).normal(size=(3, len(JOINTS)))
    expected = Predictor(MODEL).predict(*state[:, np.newaxis])
    answer = arm.feedforward.at(state)
    np.testing.assert_allclose(answer.tau, expected.tau[0], rtol=1e-9)
    np.testing.assert_allclose(answer.gravity, expected.gravity[0], rtol=1e-9)
    np.testing.assert_allclose(arm.feedforward.gravity(state[0]), answer.gravity, rtol=1e-9)
    np.testing.assert_allclose(arm.feedforward.parts(state).coriolis, expected.coriolis)
    inside = np.stack([MODEL.states.q[0], MODEL.states.dq[0], MODEL.states.ddq[0]])
    assert arm.training_range.excess(inside) <= 1.0 + 1e-12


def test_a_model_of_other_joints_is_refused(settings: ServeSettings) -> None:
    with pytest.raises(ModelError, match=r'must be a model of the joints a, b, but has joint_1,'):
        load_arm(settings, ('a', 'b'))


def test_a_successor_has_its_joints_in_the_same_order(settings: ServeSettings) -> None:
    before = load_arm(settings, ())
    assert load_successor(settings, before).feedforward.joint_names == JOINTS
    replace(MODEL, joint_names=JOINTS[::-1]).save(settings.model_path)
    with pytest.raises(ModelError, match=rf'in the order {", ".join(JOINTS)}, but has joint_'):
        load_successor(settings, before)


def test_settings_are_compared_with_the_arm_or_the_named_joints(settings: ServeSettings) -> None:
    wrong = replace(settings, torque_limits=(1.0, 2.0))
    require_rules(wrong, None)
    with pytest.raises(ConfigError, match=r'torque_limits must hold one value per joint \(1\)'):
        require_rules(replace(wrong, joints=('a',)), None)
    with pytest.raises(ConfigError, match=r'torque_limits must hold one value per joint'):
        require_rules(wrong, load_arm(settings, ()))
    with pytest.raises(ConfigError, match=r'std_limits must hold'):
        require_rules(replace(settings, std_policy='warn'), None)
