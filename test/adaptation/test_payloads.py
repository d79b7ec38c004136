"""Payloads that are taken up and put down while an arm is followed."""

from __future__ import annotations

from dataclasses import replace

from adaptation.arms import correlated_model, known_model, NOISE, Stream, stream
import numpy as np
import pytest

from lip_id_ros.adaptation.adaptation import Adaptation
from lip_id_ros.adaptation.followed import FollowedArm, WalkSettings
from lip_id_ros.adaptation.kalman import SETTLING
from lip_id_ros.adaptation.payloads import (
    known_payload,
    Payload,
    payload_of,
    PayloadEvent,
    PayloadWatch,
)
from lip_id_ros.adaptation.possible import can_exist
from lip_id_ros.arrays import Array
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body.pseudo_inertia import BODY

CENTRE = np.array([0.03, -0.02, 0.12])


def with_payload(model: InverseDynamicsModel, mass: float) -> InverseDynamicsModel:
    """Return an arm with a small ball at its last link."""
    assert model.arm is not None
    links = model.arm.links.copy()
    inertia = mass * (CENTRE @ CENTRE * np.eye(3) - np.outer(CENTRE, CENTRE) + 1e-3 * np.eye(3))
    body = np.array([mass, *(mass * CENTRE), *inertia[np.triu_indices(3)]])
    links[-1, :BODY] += body
    return replace(model, arm=replace(model.arm, links=links))


def exported(model: InverseDynamicsModel, mass: float) -> Array:
    """Return the numbers of a point mass at `CENTRE` in the frame that `lip_id export` writes."""
    return FollowedArm(model, WalkSettings()).export_frame @ known_payload(mass, CENTRE)


def carried(model: InverseDynamicsModel, mass: float, seconds: float = 60.0) -> Stream:
    """Return a motion with a payload in its second third."""
    bare, loaded = stream(model, seconds), stream(with_payload(model, mass), seconds)
    has = (bare.t >= seconds / 3.0) & (bare.t < 2.0 * seconds / 3.0)
    return bare._replace(tau=np.where(has[:, None], loaded.tau, bare.tau))


@pytest.mark.parametrize('mass', [3.0, 10.0])
def test_a_payload_is_found_when_it_is_taken_up_and_gone_when_it_is_put_down(mass: float) -> None:
    model = known_model()
    adaptation = Adaptation(model)
    data = carried(model, mass)
    followed = adaptation.update(*data)
    taken, put = adaptation.payload_events
    assert 20.0 < taken.t < 29.0
    assert 40.0 < put.t < 49.0
    assert taken.payload is not None
    assert put.payload is None
    assert adaptation.payload is None
    own = taken.payload
    assert abs(own.mass - mass) < max(0.02 * mass, 3.0 * own.mass_std)
    apart = np.abs(own.centre - exported(model, 1.0)[1:4])
    assert (apart <= np.maximum(0.01, 3.0 * own.centre_std)).all()
    late = (data.t > 30.0) & (data.t < 40.0)
    error = np.sqrt(np.mean((followed.tau - data.tau)[late] ** 2))
    frozen = np.sqrt(np.mean((followed.frozen - data.tau)[late] ** 2))
    assert error < 0.1 * frozen
    again = data.t > put.t + 0.1
    assert np.sqrt(np.mean((followed.tau - data.tau)[again] ** 2)) < 2.0 * NOISE
    assert f'{own.mass:.3g}' in taken.sentence()
    assert 'gone' in put.sentence()


def test_torques_are_as_sure_as_before_once_a_payload_is_put_down() -> None:
    """Torques with the payload have twice the variance, as where it hangs loosely."""
    model = known_model()
    adaptation = Adaptation(model)
    data = carried(model, 1.0, 120.0)
    has = (data.t >= 40.0) & (data.t < 80.0)
    more = NOISE * np.random.default_rng(3).standard_normal(data.tau.shape)
    followed = adaptation.update(*data._replace(tau=data.tau + has[:, None] * more))
    assert [each.payload is None for each in adaptation.payload_events] == [False, True]
    alone, loaded, again = (
        followed.std[(data.t > end - 10.0) & (data.t < end)].mean() for end in (40.0, 80.0, 120.0)
    )
    assert loaded > 1.2 * alone
    assert again < 1.1 * alone


def test_a_payload_that_is_announced_while_it_is_found_counts_once() -> None:
    model = known_model()
    adaptation = Adaptation(model)
    data = carried(model, 3.0)
    number = np.digitize(data.t, [22.0, 23.0])
    before, while_found, after = (Stream(*(x[number == k] for x in data)) for k in range(3))
    adaptation.update(*before)
    assert adaptation.update(*while_found).outcome[-1] == SETTLING
    adaptation.announce(exported(model, 3.0))
    error = (adaptation.update(*after).tau - after.tau)[:20]
    assert np.sqrt(np.mean(error**2)) < 2.0 * NOISE


def test_an_announced_payload_is_told_whole_where_more_comes_and_gone_where_it_is_put_down() -> (
    None
):
    model = known_model()
    adaptation = Adaptation(model)
    adaptation.announce(exported(model, 2.0))
    for k, mass in enumerate((2.0, 3.0, 0.0)):
        adaptation.update(*stream(with_payload(model, mass), 30.0, seed=k, start=30.0 * k))
    announced, more, gone = adaptation.payload_events
    assert announced.payload is not None
    assert announced.payload.mass == pytest.approx(2.0)
    assert more.payload is not None
    assert 2.5 < more.payload.mass < 3.5
    assert gone.payload is None
    assert adaptation.payload is None
    assert adaptation.announced_mass == 0.0
    later = stream(model, 10.0, seed=4, start=90.0)
    error = adaptation.update(*later).served - later.tau
    assert np.sqrt(np.mean(error**2)) < 1.5 * NOISE


def test_contacts_and_changes_of_friction_are_no_payloads() -> None:
    model = known_model()
    adaptation = Adaptation(model)
    data = stream(model, 300.0)
    pushed = (data.t % 7.0 < 1.5)[:, None] * np.array([3.0, -4.0, 2.0])
    adaptation.update(*data._replace(tau=data.tau + pushed))
    assert adaptation.payload_events == []


def test_no_payload_is_found_where_the_arm_was_not_understood_before_it() -> None:
    """Waves of three deviations in a torque: the next disturbance may be anything."""
    model = known_model()
    adaptation, data = Adaptation(model), carried(model, 1.0)
    wave = 3.0 * NOISE * np.sin(9.0 * data.t)[:, None] * np.array([0.0, 1.0, 0.0])
    adaptation.update(*data._replace(tau=data.tau + wave))
    assert adaptation.payload_events == []


def test_a_joint_that_is_held_while_it_rests_hides_no_payload() -> None:
    model, mass = known_model(), 3.0

    def held(arm: InverseDynamicsModel) -> Stream:
        t, *states, _ = stream(arm, 45.0)
        q, dq, ddq = (x * [0.0, 1.0, 1.0] for x in states)
        tau = arm.predict(q, dq, ddq).tau + [1.0, 0.0, 0.0]
        noise = NOISE * np.random.default_rng(0).standard_normal(q.shape)
        return Stream(t, q, dq, ddq, tau + noise)

    bare, loaded = held(model), held(with_payload(model, mass))
    adaptation = Adaptation(model)
    adaptation.update(*bare._replace(tau=np.where(bare.t[:, None] < 30.0, bare.tau, loaded.tau)))
    (found,) = adaptation.payload_events
    assert found.payload is not None


def test_a_body_is_found_by_least_squares_with_its_deviations() -> None:
    rng = np.random.default_rng(0)
    body = np.array([1.0, 0.03, -0.02, 0.12, 0.02, 0.001, 0.0, 0.02, 0.0, 0.002])
    slopes = rng.normal(size=(200, 3, BODY))
    residual = slopes @ body + 0.1 * rng.normal(size=(200, 3))
    variance = np.full_like(residual, 0.01)
    variance[::2, 1] = np.inf
    residual[::2, 1] = 1e6
    watch, once = PayloadWatch(3, 0.0), np.ones(200)
    watch.add(10.0, slopes[:100], residual[:100], variance[:100], once[:100])
    watch.add(10.0, slopes[100:], residual[100:], variance[100:], once[100:])
    assert watch.is_payload
    assert (np.abs(watch.body - body) < 4.0 * np.sqrt(np.diagonal(watch.covariance))).all()
    watch.add(10.0, slopes, residual + 3.0, variance, once)
    assert not watch.is_payload


def test_noise_that_lasts_counts_once() -> None:
    """Samples that come three times, of an inflation of three, say what they say once."""
    rng = np.random.default_rng(3)
    body = np.array([1.0, 0.03, -0.02, 0.12, 0.02, 0.001, 0.0, 0.02, 0.0, 0.002])
    slopes = rng.normal(size=(50, 3, BODY))
    samples = slopes, slopes @ body + 0.2 * rng.normal(size=(50, 3)), np.full((50, 3), 0.01)
    once, lasting = PayloadWatch(3, 0.0), PayloadWatch(3, 0.0)
    once.add(3.0, *samples, np.ones(50))
    slopes, residual, variance = (np.repeat(each, 3, axis=0) for each in samples)
    lasting.add(3.0, slopes, residual, variance, np.full(150, 3.0))
    np.testing.assert_allclose(lasting.body, once.body)
    np.testing.assert_allclose(lasting.covariance, once.covariance)
    np.testing.assert_allclose(lasting.left_of_joints, once.left_of_joints)
    np.testing.assert_allclose(lasting.mean_square(body), once.mean_square(body))


def test_the_deviation_of_a_centre_is_that_of_samples() -> None:
    rng = np.random.default_rng(1)
    body = np.array([2.0, 0.2, -0.1, 0.3, *np.zeros(6)])
    root = 0.01 * rng.normal(size=(BODY, BODY))
    own = payload_of(body, root @ root.T)
    drawn = body + rng.normal(size=(20_000, BODY)) @ root.T
    np.testing.assert_allclose(own.centre, body[1:4] / body[0])
    np.testing.assert_allclose(own.mass_std, drawn[:, 0].std(), rtol=0.05)
    np.testing.assert_allclose(
        own.centre_std, (drawn[:, 1:4] / drawn[:, :1]).std(axis=0), rtol=0.05
    )
    assert np.isnan(payload_of(0.0 * body, root @ root.T).centre).all()


def test_an_event_gives_numbers_with_deviations_where_they_are_known() -> None:
    known = PayloadEvent(3.0, Payload(1.0, 0.01, CENTRE, np.full(3, 0.002)))
    assert known.sentence() == (
        'At 3.0 s the payload is 1 ± 0.01 kg, its centre of mass at '
        '(0.030 ± 0.002, -0.020 ± 0.002, 0.120 ± 0.002) m in the frame of the last link.'
    )
    assert known.to_json() == {
        't': 3.0,
        'mass': 1.0,
        'mass_std': 0.01,
        'centre': CENTRE.tolist(),
        'centre_std': [0.002] * 3,
    }
    assert PayloadEvent(4.0, None).to_json() == {'t': 4.0, 'mass': None}
    unknown = PayloadEvent(5.0, payload_of(np.zeros(BODY), np.eye(BODY)))
    assert unknown.sentence().endswith('± 1 kg, its centre of mass unknown.')
    assert unknown.to_json()['centre'] is None


def test_what_places_of_joints_leave_open_is_no_contact() -> None:
    """What remains is a twentieth of the torques of a body, and a third."""
    rng = np.random.default_rng(2)
    body = np.array([1.0, 0.03, -0.02, 0.12, 0.02, 0.001, 0.0, 0.02, 0.0, 0.002])
    slopes = rng.normal(size=(200, 3, BODY))
    explained = slopes @ body
    variance = np.full_like(explained, 1e-4)
    for share, unsure, is_payload in ((0.05, 0.0, False), (0.05, 1.0, True), (0.33, 1.0, False)):
        watch = PayloadWatch(3, unsure)
        rest = share * explained[:, [2, 0, 1]] * np.array([0.0, 1.0, 2.0])
        watch.add(10.0, slopes, explained + rest, variance, np.ones(200))
        assert watch.is_payload is is_payload
        left = watch.left_of_joints
        assert left[0] < left[1] < left[2]
        assert abs(watch.body[0] - 1.0) < 4.0 * np.sqrt(watch.covariance[0, 0])


def test_places_of_joints_that_are_not_sure_leave_torques_of_payloads_open() -> None:
    model = known_model()
    assert model.arm is not None
    assert FollowedArm(model, WalkSettings()).unsure_of_payloads == 0.0
    found = []
    for std in (0.01, 0.02):
        root = np.pad(model.arm.covariance_root, ((0, 0), (0, 6)))
        root[12:18, -6:] = std * np.eye(6)  # of the last joint
        unsure = replace(model, arm=replace(model.arm, covariance_root=root))
        found.append(FollowedArm(unsure, WalkSettings()).unsure_of_payloads)
    assert found[0] > 0.0
    np.testing.assert_allclose(found[1], 4.0 * found[0], rtol=1e-6)


def test_a_body_that_no_link_can_carry_becomes_the_nearest_that_one_can() -> None:
    model = known_model()
    assert model.arm is not None
    arm, link = FollowedArm(model, WalkSettings()), model.arm.links[-1, :BODY]
    body = known_payload(0.5, CENTRE)
    np.testing.assert_array_equal(arm.possible_body(link, body, np.eye(BODY)), body)
    information = np.diag([1e6, *3 * (1e6,), *6 * (1.0,)])
    wrong = body.copy()
    wrong[4] = -5.0
    found = arm.possible_body(link, wrong, information)
    assert can_exist(np.append(link + found, model.arm.links[-1, -1])[None])
    np.testing.assert_allclose(found[:4], wrong[:4], atol=5e-3)


def test_a_payload_that_is_not_known_yet_is_not_kept_over_a_restart() -> None:
    """It would be a part of the arm, and nothing that can be put down."""
    adaptation = Adaptation(known_model())
    data = carried(known_model(), 3.0)
    first = next(
        k for k in range(0, data.t.size, 5)
        if (adaptation.update(*(x[k : k + 5] for x in data)).outcome == SETTLING).any()
    )  # fmt: skip
    again = Adaptation(known_model())
    again.resume(adaptation.state(), 0.0)
    again.update(*(x[first + 5 :] for x in data))
    taken, put = again.payload_events
    assert taken.payload is not None
    assert put.payload is None


def test_a_payload_says_nothing_of_friction_after_a_pause() -> None:
    model = correlated_model()
    adaptation = Adaptation(model)
    adaptation.announce(exported(model, 2.0))
    before = adaptation.numbers.copy()
    adaptation.pause(1e4)
    np.testing.assert_allclose(adaptation.numbers, before)


def test_a_payload_that_was_found_says_nothing_of_friction_after_a_pause() -> None:
    model = correlated_model()
    adaptation = Adaptation(model)
    bare, loaded = stream(model, 20.0), stream(with_payload(model, 1.0), 20.0, start=20.0)
    adaptation.update(*bare)
    adaptation.update(*loaded)
    assert adaptation.payload is not None
    friction, links = adaptation.arm.friction, adaptation.arm.last_body
    adaptation.numbers[: friction.start] = adaptation.arm.start[: friction.start]
    adaptation.numbers[links] += adaptation._found
    adaptation.pause(1e6)
    np.testing.assert_allclose(
        adaptation.numbers[friction], adaptation.arm.start[friction], rtol=1e-9
    )
