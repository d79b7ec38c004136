"""Models: served as they are, or refused with the reason."""

from __future__ import annotations

from dataclasses import replace
import os
from pathlib import Path

from adaptation.arms import known_model, message_of
from feedforward.arms import arm, Sum
from gp.processes import process_of
from model.models import random_model
import numpy as np
import pytest

from lip_id_ros.adaptation.updates import Update
from lip_id_ros.errors import ConfigError, ModelError
from lip_id_ros.feedforward.loading import (
    load_model,
    load_models,
    load_successor,
    require_rules,
)
from lip_id_ros.feedforward.measured import MeasuredArm
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.feedforward.shaping import TrainingRange
from lip_id_ros.model import InverseDynamicsModel

JUDGED = {'motion_s': 9.0, 'new_motion_s': 9.0, 'unexplained_percent': [9.0] * 3}
MODEL = replace(random_model('recursive'), summary=JUDGED)
JOINTS = MODEL.joint_names


@pytest.fixture
def settings(tmp_path: Path) -> ServeSettings:
    path = str(tmp_path / 'model.npz')
    MODEL.save(path)
    return ServeSettings(model_path=path)


def test_a_loaded_model_answers_as_its_file(settings: ServeSettings) -> None:
    loaded = load_model(settings, JOINTS[::-1])
    state = np.random.default_rng(0).normal(size=(3, len(JOINTS)))
    expected = MODEL.predict(*state[:, np.newaxis])
    query = loaded.model.query(*state)
    np.testing.assert_allclose(query.tau, expected.tau[0], rtol=1e-9)
    np.testing.assert_allclose(query.gravity, expected.gravity[0], rtol=1e-9)
    found = loaded.model.predict(*state[:, np.newaxis])
    np.testing.assert_allclose(found.coriolis, expected.coriolis)
    x = process_of(MODEL).states
    inside = np.stack([x.q[0], x.dq[0], x.ddq[0]])
    assert TrainingRange(*loaded.model.training_range).excess(inside) <= 1.0 + 1e-12


def test_friction_is_served_as_drives_have_it(tmp_path: Path) -> None:
    """A recording's low-pass softens friction at reversals; the torques of drives have none."""
    fitted = replace(known_model().with_rise_time(0.05), summary=JUDGED)
    path = str(tmp_path / 'arm.npz')
    fitted.save(path)
    settings = ServeSettings(model_path=path, follow_adaptation=True)
    state = np.array([[0.3, -0.4, 0.5], [0.05, -0.05, 0.05], [2.0, 2.0, -2.0]])
    steady, softened = known_model().query(*state).tau, fitted.query(*state).tau
    assert np.abs(steady - softened).min() > 0.01
    for followed in (settings, replace(settings, follow_adaptation=False)):
        loaded = load_model(followed, ())
        np.testing.assert_allclose(loaded.query(state, 0.0).tau, steady, rtol=1e-9)
        planned = loaded.newest.predict(*state[:, np.newaxis]).tau[0]
        np.testing.assert_allclose(planned, steady, rtol=1e-9)
        measured = MeasuredArm(loaded, 20.0)
        recorded = measured.model_of_filtered_torques().query(*state).tau
        np.testing.assert_allclose(recorded, softened, rtol=1e-9)


def test_updates_are_about_the_fitted_model(tmp_path: Path) -> None:
    fitted = replace(known_model().with_rise_time(0.05), summary=JUDGED)
    path = str(tmp_path / 'arm.npz')
    fitted.save(path)
    loaded = load_model(ServeSettings(model_path=path, follow_adaptation=True), ())
    assert fitted.arm is not None
    assert loaded.adapted is not None
    numbers = [fitted.arm.links.ravel(), 1.01 * fitted.arm.friction.coefficients]
    update = Update(fitted.fingerprint, np.concatenate(numbers), True)
    loaded.adapted.take(message_of(update), 0.0, 0)
    assert loaded.adapted.values()['followed'] == 1


def test_a_model_of_other_joints_is_refused(settings: ServeSettings) -> None:
    with pytest.raises(ModelError, match=r'must be a model of the joints a, b, but has joint_1,'):
        load_model(settings, ('a', 'b'))


def test_a_model_that_is_not_proven_is_refused(settings: ServeSettings) -> None:
    before = len(os.listdir('/proc/self/fd'))
    for changed, lack in (
        ({'new_motion_s': 5.0}, 'its recording has 1 s of motion that is not repeated'),
        (
            {'unexplained_percent': [9.0, 200.0, 9.0]},
            'better than the mean .* joint_2 \\(200 %\\)',
        ),
        ({'unexplained_percent': None}, 'its file does not say on what motion it was judged;'),
    ):
        replace(MODEL, summary={**JUDGED, **changed}).save(settings.model_path)
        sentence = (
            f'npz must be a model that is proven on unseen motion, but .*{lack}.*, or set acc'
        )
        with pytest.raises(ModelError, match=sentence):
            load_model(settings, JOINTS)
        load_model(replace(settings, accept_unproven=True), JOINTS)
    assert len(os.listdir('/proc/self/fd')) == before


def test_a_payload_that_is_not_proven_is_refused(settings: ServeSettings, tmp_path: Path) -> None:
    loaded = str(tmp_path / 'loaded.npz')
    replace(MODEL, summary={}).save(loaded)
    with pytest.raises(ModelError, match=r'loaded\.npz must be a model that is proven'):
        load_models(replace(settings, payload_models=(loaded,)), None)


def test_a_judgement_that_makes_no_sense_is_an_error_of_the_file(settings: ServeSettings) -> None:
    replace(MODEL, summary={**JUDGED, 'held_out': 'yes'}).save(settings.model_path)
    with pytest.raises(ModelError, match='contradicts itself'):
        load_model(settings, JOINTS)


def test_a_successor_has_its_joints_in_the_same_order(settings: ServeSettings) -> None:
    before = load_model(settings, ())
    assert load_successor(settings, before).joint_names == JOINTS
    replace(MODEL, joint_names=JOINTS[::-1]).save(settings.model_path)
    with pytest.raises(ModelError, match=rf'in the order {", ".join(JOINTS)}, but has joint_'):
        load_successor(settings, before)


def test_settings_are_compared_with_the_arm_or_the_named_joints(settings: ServeSettings) -> None:
    wrong = replace(settings, torque_limits=(1.0, 2.0))
    require_rules(wrong, None)
    with pytest.raises(ConfigError, match=r'torque_limits must hold one value per joint \(1\)'):
        require_rules(replace(wrong, joints=('a',)), None)
    with pytest.raises(ConfigError, match=r'torque_limits must hold one value per joint'):
        require_rules(wrong, load_model(settings, ()))


def test_a_model_without_gravity_is_for_robots_that_add_their_own() -> None:
    compensated = replace(arm(), model=Sum(has_potential=False))
    require_rules(ServeSettings(gravity=False), compensated)
    require_rules(ServeSettings(), arm())
    with pytest.raises(ConfigError, match=r'^gravity is true, but the model has none, since'):
        require_rules(ServeSettings(), compensated)


def test_a_joint_named_twice_is_refused(settings: ServeSettings) -> None:
    twice = replace(settings, joints=('a', 'a', 'b'), torque_limits=(1.0, 99.0, 2.0))
    with pytest.raises(ConfigError, match=r"^joints must name each joint once, but 'a' comes twi"):
        require_rules(twice, None)
    with pytest.raises(ConfigError, match=r"^joints must name each joint once, but 'a' comes twi"):
        require_rules(twice, load_model(settings, ()))


def test_a_payload_without_a_name_is_refused(settings: ServeSettings) -> None:
    nameless = replace(settings, payload_models=('',))
    for use in (lambda: load_models(nameless, None), lambda: require_rules(nameless, None)):
        with pytest.raises(ConfigError, match=r'^payload_models must name a file each, but one'):
            use()


def test_a_payload_named_twice_is_loaded_once(settings: ServeSettings) -> None:
    before = len(os.listdir('/proc/self/fd'))
    path = settings.model_path
    models = load_models(replace(settings, payload_models=(path, path)), None)
    assert list(models) == ['', path]
    assert len(os.listdir('/proc/self/fd')) == before


def test_what_cannot_be_read_is_named_and_leaves_no_descriptor(
    settings: ServeSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever comes is an error that a reload answers; any other published zero in mid-stream."""
    unreadable = f'/proc/{os.getpid()}/mem'
    (tmp_path / 'broken.npz').write_bytes(b'no model')
    before = len(os.listdir('/proc/self/fd'))
    for _ in range(3):
        with pytest.raises(ModelError, match=f'{unreadable} must be a model'):
            load_model(replace(settings, model_path=unreadable), ())
        with pytest.raises(ModelError, match=r'broken\.npz must be a model'):
            load_model(replace(settings, model_path=str(tmp_path / 'broken.npz')), ())

    def fail(path: str) -> None:
        raise MemoryError('no memory')

    monkeypatch.setattr(InverseDynamicsModel, 'load', fail)
    with pytest.raises(ModelError, match=r'model\.npz must .* but MemoryError came \(no memory\)'):
        load_model(settings, ())
    assert len(os.listdir('/proc/self/fd')) == before
