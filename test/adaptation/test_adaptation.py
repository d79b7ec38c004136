"""An arm whose friction changes is followed, and nothing else moves it."""

from __future__ import annotations

from dataclasses import replace

from adaptation.arms import (
    correlated_model,
    known_model,
    NOISE,
    RANGES,
    RATE_HZ,
    Stream,
    stream,
    with_friction,
)
from model.models import random_model
import numpy as np
import pytest

from lip_id_ros.adaptation.adaptation import Adaptation, CHUNK
from lip_id_ros.adaptation.changes import change_lines, changes, friction_at_speed
from lip_id_ros.adaptation.followed import WalkSettings
from lip_id_ros.adaptation.kalman import DISTURBED, STUCK
from lip_id_ros.adaptation.possible import can_exist
from lip_id_ros.adaptation.trust import RecentErrors
from lip_id_ros.errors import DataError, ModelError, ShapeError
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED

MEMBER = 'lip'


def rms(errors: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def error_of(model: InverseDynamicsModel, data: Stream) -> float:
    """Return the error of a model along a stream."""
    return rms(model.predict(data.q, data.dq, data.ddq, data.t).tau - data.tau)


def test_friction_that_falls_is_followed_with_deviations_that_hold() -> None:
    model = known_model()
    warm = with_friction(model, 0.6)
    data, later = stream(warm, 60.0), stream(warm, 30.0, seed=1)
    adaptation = Adaptation(model)
    followed = adaptation.update(*data)
    assert followed.learned.all()
    assert error_of(adaptation.model, later) < 1.1 * error_of(warm, later)
    assert error_of(model, later) > 5.0 * error_of(warm, later)
    within = np.abs(followed.tau - data.tau) <= 2.0 * followed.std
    assert 0.85 <= within.mean() <= 0.995
    torque, std = friction_at_speed(adaptation)
    truth, _ = friction_at_speed(Adaptation(warm))
    assert (np.abs(torque - truth) < 3.0 * std).all()


def test_errors_that_the_fit_did_not_have_widen_the_deviations_of_their_joint() -> None:
    """Torques of joint 2 follow a wave that no link and no friction explains."""
    model = known_model()
    data, noise = stream(model, 60.0), model.noise_std[1]
    wave = 4.0 * noise * np.sin(9.0 * data.t)[:, None] * np.array([0.0, 1.0, 0.0])
    plain, waved = (
        Adaptation(model).update(*data._replace(tau=data.tau + each)) for each in (0.0, wave)
    )
    late = data.t > 30.0
    within = np.abs(waved.tau - data.tau - wave) <= 2.0 * waved.std
    assert 0.85 <= within[late, 1].mean() <= 0.99
    wider = (waved.std / plain.std)[late].mean(axis=0)
    assert wider[1] > 2.0
    assert (wider[[0, 2]] < 1.3).all()


def test_what_has_changed_is_named_and_an_arm_that_has_not_is_not_blamed() -> None:
    model = known_model()
    same, other = Adaptation(model), Adaptation(model)
    same.update(*stream(model, 40.0))
    assert changes(same) == []
    assert change_lines([]) == [
        'No friction now differs surely from that of the fit by a tenth or more.'
    ]
    other.update(*stream(with_friction(model, 0.6), 40.0))
    found = changes(other)
    assert {each.joint for each in found} == set(model.joint_names)
    friction = [each for each in found if each.what.startswith('friction')]
    np.testing.assert_allclose([x.now / x.before for x in friction], 0.6, atol=0.05)
    assert 'standard deviations' in friction[0].sentence()
    _, now = friction_at_speed(other)
    _, fitted = friction_at_speed(Adaptation(model, WalkSettings(0.0, 0.0, 0.0)))
    np.testing.assert_allclose([each.std for each in friction], np.hypot(now, fitted))
    speed = other.arm.speed
    np.testing.assert_allclose([x.before for x in friction], 0.8 * speed + 0.6, rtol=1e-6)


def test_a_torque_that_does_not_turn_with_the_motion_is_told_as_it_is() -> None:
    model = known_model()
    assert model.arm is not None
    friction = model.arm.friction
    values = friction.coefficients + np.eye(9)[5]  # the offset of joint 2, by 1 N m
    other = FrictionModel(friction.basis, values)
    adaptation = Adaptation(model)
    adaptation.update(*stream(replace(model, arm=replace(model.arm, friction=other)), 40.0))
    (found,) = changes(adaptation)
    assert (found.joint, found.unit) == (model.joint_names[1], 'N m')
    assert found.what.startswith('torque without direction at')
    assert found.before == pytest.approx(0.05)
    assert found.now == pytest.approx(1.05, abs=3.0 * found.std)
    assert found.std < 0.05
    usual = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 2000, 3)) * RANGES
    size = rms(model.predict(*usual).friction[:, 1])
    assert found.share == pytest.approx((found.now - 0.05) / size, rel=0.1)


def test_a_change_that_is_sure_but_small_is_not_named() -> None:
    model = known_model()
    assert model.arm is not None
    sharp = replace(model, arm=replace(model.arm, covariance_root=0.1 * model.arm.covariance_root))
    adaptation = Adaptation(sharp)
    adaptation.update(*stream(with_friction(sharp, 0.95), 40.0))
    fitted, _ = friction_at_speed(Adaptation(sharp))
    now, std = friction_at_speed(adaptation)
    assert (fitted - now > 6.0 * std).all()
    assert changes(adaptation) == []


def contact(data: Stream) -> Stream:
    """Push at every joint for a third of the time."""
    pushed = (data.t % 6.0 < 2.0)[:, None] * np.array([3.0, -4.0, 2.0])
    return data._replace(tau=data.tau + pushed)


def turned(data: Stream) -> Stream:
    """Turn the sign of a joint's effort."""
    return data._replace(tau=data.tau * np.array([1.0, -1.0, 1.0]))


def stuck(data: Stream) -> Stream:
    """Hold the effort of a joint."""
    tau = data.tau.copy()
    tau[:, 1] = tau[0, 1]
    return data._replace(tau=tau)


def exchanged(data: Stream) -> Stream:
    """Exchange the efforts of two joints."""
    return data._replace(tau=data.tau[:, [1, 0, 2]])


def at_rest(data: Stream) -> Stream:
    """Stand still, held by friction that is anything."""
    still = np.zeros_like(data.q)
    held = 0.4 * np.sin(0.01 * data.t)[:, None] + np.mean(data.tau, axis=0)
    return Stream(data.t, still + data.q[0], still, still, held)


def one_sine(data: Stream) -> Stream:
    """Move one joint alone, to and fro."""
    q, dq, ddq = (np.zeros_like(data.q) for _ in range(3))
    q[:, 0], dq[:, 0], ddq[:, 0] = np.sin(data.t), np.cos(data.t), -np.sin(data.t)
    return Stream(data.t, q, dq, ddq, known_model().predict(q, dq, ddq, data.t).tau)


@pytest.mark.parametrize('spoil', [contact, turned, stuck, exchanged, at_rest, one_sine])
def test_bad_data_make_no_model_that_is_worse_than_the_fit(spoil: object) -> None:
    model = known_model()
    adaptation = Adaptation(model)
    assert callable(spoil)
    adaptation.update(*spoil(stream(model, 600.0)))
    assert np.isfinite(adaptation.numbers).all()
    later = stream(model, 30.0, seed=1, start=600.0)
    assert error_of(adaptation.model, later) < 1.1 * error_of(model, later)
    assert adaptation.model.arm is not None
    assert can_exist(adaptation.model.arm.links)


def test_what_is_not_seen_returns_to_the_fit_by_two_thirds_in_the_hours_of_the_walk() -> None:
    model = known_model()
    adaptation = Adaptation(model, WalkSettings(hours=0.5))
    adaptation.update(*stream(with_friction(model, 0.6), 40.0))
    fitted, _ = friction_at_speed(Adaptation(model))
    before, _ = friction_at_speed(adaptation)
    last = stream(model, 1.0 / RATE_HZ, start=40.0 + 1800.0)
    adaptation.update(*last._replace(tau=last.tau + 100.0))  # of which nothing is learned
    now, _ = friction_at_speed(adaptation)
    np.testing.assert_allclose((now - fitted) / (before - fitted), np.exp(-1.0), rtol=1e-3)


def test_what_was_learned_returns_to_the_fit_while_nothing_runs() -> None:
    model = known_model()
    adaptation, again = (Adaptation(model, WalkSettings(hours=0.5)) for _ in range(2))
    adaptation.update(*stream(with_friction(model, 0.6), 40.0))
    again.resume(adaptation.state(), 1800.0)
    fitted, _ = friction_at_speed(Adaptation(model))
    before, _ = friction_at_speed(adaptation)
    now, _ = friction_at_speed(again)
    np.testing.assert_allclose((now - fitted) / (before - fitted), np.exp(-1.0), rtol=1e-3)


def test_a_time_without_samples_leaves_open_what_the_fit_left_open() -> None:
    """Beside what has changed meanwhile, and as the links have it, which do not change."""
    model = correlated_model()
    adaptation = Adaptation(model)
    before = adaptation.covariance.copy()
    adaptation.pause(1e6)
    np.testing.assert_allclose(adaptation.covariance, before, rtol=1e-6, atol=1e-12)
    adaptation.update(*stream(model, 40.0))
    adaptation.pause(1e6)
    friction = adaptation.covariance[-9:, -9:]
    walk, links = adaptation.arm.walk, adaptation.covariance[:-9, :-9]
    np.testing.assert_allclose(friction, walk.covariance + walk.slopes @ links @ walk.slopes.T)
    assert np.linalg.eigvalsh(adaptation.covariance).min() > -1e-9


def with_noise_that_lasts(
    model: InverseDynamicsModel, inflation: float, interval: float
) -> InverseDynamicsModel:
    """Return a model of samples so far apart, whose noise lasts."""
    sources = [{'rate_hz': 10.0 / interval, 'kept_every': 10}]
    summary = {'covariance_inflation': inflation}
    return replace(model, summary=summary, provenance={'sources': sources})


def test_noise_that_lasts_says_as_much_in_a_second_at_any_rate() -> None:
    model = known_model()
    lasting = with_noise_that_lasts(model, 2.0, 1.0 / RATE_HZ)
    data = stream(model, 40.0)
    slow, often = Adaptation(lasting), Adaptation(lasting)
    slow.update(*data)
    parts = 8
    t = data.t[0] + np.arange(len(data.t) * parts) / (RATE_HZ * parts)
    often.update(t, *(np.repeat(each, parts, axis=0) for each in data[1:]))
    np.testing.assert_allclose(
        np.diagonal(often.covariance), np.diagonal(slow.covariance), rtol=0.1
    )
    np.testing.assert_allclose(often.numbers, slow.numbers, atol=2e-3)
    rare, white = Adaptation(lasting), Adaptation(model)
    few = [each[::4] for each in data]
    rare.update(*few)  # farther apart than the noise lasts
    white.update(*few)
    np.testing.assert_allclose(rare.covariance, white.covariance, rtol=1e-6, atol=1e-12)


def test_a_push_is_a_disturbance_however_long_the_noise_lasts() -> None:
    model = with_noise_that_lasts(known_model(), 50.0, 1.0 / RATE_HZ)
    adaptation = Adaptation(model, WalkSettings(0.0, 0.0, 0.0))
    adaptation.update(*stream(model, 40.0))
    data = stream(model, 5.0, seed=1, start=40.0)
    outcome = adaptation.update(*data._replace(tau=data.tau + 20.0 * NOISE)).outcome
    assert (outcome == DISTURBED).all()


def test_errors_of_a_joint_that_last_are_no_disturbance_of_it() -> None:
    """A wave that no link and no friction explains grows to ten deviations of the noise."""
    model = known_model()
    adaptation = Adaptation(model, WalkSettings(0.0, 0.0, 0.0))
    data = stream(model, 90.0)
    wave = np.minimum(data.t / 6.0, 10.0) * NOISE * np.sin(9.0 * data.t)
    for joint, disturbed in ((1, False), (0, True)):
        grown = data.tau.copy()
        grown[:, 1] += wave
        grown[data.t > 80.0, joint] += 12.0 * NOISE * (joint == 0)
        adaptation.reset()
        adaptation.pause(0.0)
        outcome = adaptation.update(*data._replace(tau=grown)).outcome
        assert (outcome == DISTURBED).any() == disturbed


def test_what_was_learned_is_served_after_seconds_of_motion_that_prove_it() -> None:
    model = known_model()
    data = stream(with_friction(model, 0.8), 20.0)
    followed = Adaptation(model).update(*data)
    begins = float(data.t[followed.trusted][0])
    assert 5.0 < begins < 11.0
    assert followed.trusted[data.t > begins].all()
    np.testing.assert_array_equal(
        followed.served[~followed.trusted], followed.frozen[~followed.trusted]
    )


def test_few_large_errors_do_not_decide_what_is_trusted_and_small_ones_count_as_squares() -> None:
    model = known_model()
    adaptation = Adaptation(model, WalkSettings(0.0, 0.0, 0.0))
    adaptation.update(*stream(model, 60.0))
    learned, fitted = adaptation.errors
    assert 0.5 < learned < 1.0  # of noise: squares of one in the mean, as exp(mean log(1 + x)) - 1
    np.testing.assert_allclose(learned, fitted, rtol=0.1)
    data = stream(with_friction(model, 0.8), 60.0, start=60.0)
    adaptation = Adaptation(model)
    adaptation.update(*data)
    pushed = np.where((data.t % 6.0 < 0.5)[:, None], data.tau + 1e3, data.tau)
    adaptation.update(*data._replace(t=data.t + 60.0, tau=pushed))
    learned, fitted = adaptation.errors
    assert learned < 0.5 * fitted


def test_an_error_without_measure_is_forgotten_in_time() -> None:
    recent = RecentErrors(1)
    std, sound, steps = np.ones((200, 1)), np.full((200, 1), 2.0), np.full(200, 0.1)
    none = np.zeros(200, dtype=np.bool_)
    recent.judge(steps[:1], np.full((1, 1), 1e300), np.full((1, 1), 1e300), std[:1], none[:1])
    for _ in range(10):
        recent.judge(steps, sound, 0.5 * sound, std, none)
    learned, fitted = recent.squares
    assert learned == pytest.approx(4.0, rel=1e-3)
    assert fitted == pytest.approx(1.0, rel=1e-3)
    assert not recent.is_trusted


def test_what_got_worse_than_the_fit_is_forgotten() -> None:
    """Friction is half for a minute, then as fitted, in jumps that the filter is late for."""
    model = known_model()
    adaptation = Adaptation(model)
    adaptation.update(*stream(with_friction(model, 0.8), 60.0))
    adaptation.numbers[-1] += 0.5  # an estimate that went astray
    adaptation.covariance *= 1e-12
    adaptation.update(*stream(model, 60.0, start=60.0))
    assert adaptation.n_forgotten >= 1
    later = stream(model, 30.0, seed=1, start=120.0)
    assert error_of(adaptation.model, later) < 1.1 * error_of(model, later)


def test_what_is_worse_than_the_fit_is_not_trusted_nor_anything_among_disturbances() -> None:
    model = known_model()
    adaptation = Adaptation(model)
    adaptation.update(*stream(with_friction(model, 0.8), 60.0))
    assert adaptation.is_trusted
    learned = adaptation.state()
    pushed = stream(with_friction(model, 0.8), 20.0, start=60.0)
    adaptation.update(*pushed._replace(tau=pushed.tau + 1e3))
    assert not adaptation.is_trusted
    assert adaptation.model is adaptation.arm.fitted
    adaptation.resume(learned, 0.0)
    adaptation.update(*stream(model, 5.0, seed=1))  # its friction is that of the fit
    assert not adaptation.is_trusted
    assert adaptation.n_forgotten == 0
    followed = adaptation.update(*stream(model, 0.5, seed=2, start=5.0))
    np.testing.assert_array_equal(followed.served, followed.frozen)


def test_a_torque_that_stands_still_is_left_out_while_its_joint_moves() -> None:
    model = known_model()
    adaptation = Adaptation(model)
    adaptation.update(*stream(with_friction(model, 0.8), 60.0))
    assert adaptation.is_trusted
    data = stream(with_friction(model, 0.8), 60.0, seed=1, start=60.0)
    tau = data.tau.copy()
    tau[:, 1] = 0.3
    outcome = adaptation.update(*data._replace(tau=tau)).outcome
    assert (outcome[40:] == STUCK).mean() > 0.8
    assert adaptation.is_trusted
    later = stream(with_friction(model, 0.8), 30.0, seed=2, start=120.0)
    assert error_of(adaptation.model, later) < 0.2 * error_of(model, later)


def test_pieces_of_a_stream_are_the_stream() -> None:
    model = known_model(memory=True)
    data = stream(with_friction(model, 0.7), 3 * CHUNK / RATE_HZ)
    whole, pieces = Adaptation(model), Adaptation(model)
    expected = whole.update(*data).tau
    found = [
        pieces.update(*(x[k : k + CHUNK] for x in data)).tau for k in range(0, data.t.size, CHUNK)
    ]
    np.testing.assert_array_equal(np.concatenate(found), expected)
    np.testing.assert_array_equal(pieces.covariance, whole.covariance)


def test_a_fit_that_remembers_is_the_model_along_a_stream() -> None:
    model = known_model(memory=True)
    data = stream(model, 20.0)
    expected = model.predict(data.q, data.dq, data.ddq, data.t).tau
    np.testing.assert_allclose(Adaptation(model).update(*data).frozen, expected, atol=1e-12)


def test_a_fit_with_a_residual_process_is_the_model() -> None:
    model = random_model(ARTICULATED)
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 6, model.n_joints))
    found = Adaptation(model).update(np.arange(6.0), q, dq, ddq, np.zeros_like(q))
    expected = model.predict(q, dq, ddq, np.arange(6.0)).tau
    np.testing.assert_allclose(found.frozen, expected, rtol=1e-9)


@pytest.mark.parametrize(
    ('change', 'error', 'sentence'),
    [
        (lambda s: s._replace(tau=np.full_like(s.tau, np.nan)), DataError, 'finite'),
        (lambda s: s._replace(t=np.full_like(s.t, np.inf)), DataError, 'finite'),
        (lambda s: s._replace(t=s.t[::-1]), DataError, 'do not go back'),
        (lambda s: s._replace(q=s.q[:, :2]), ShapeError, 'one row for each time'),
        (lambda s: s._replace(t=s.t[:-1]), ShapeError, 'one row for each time'),
    ],
)
def test_samples_that_cannot_be_used_are_refused_and_change_nothing(
    change: object, error: type[Exception], sentence: str
) -> None:
    model = known_model()
    adaptation = Adaptation(model)
    before = adaptation.numbers.copy()
    assert callable(change)
    with pytest.raises(error, match=sentence):
        adaptation.update(*change(stream(model, 5.0)))
    np.testing.assert_array_equal(adaptation.numbers, before)


def test_a_process_on_energies_cannot_be_followed() -> None:
    with pytest.raises(ModelError, match='default kernel'):
        Adaptation(random_model(MEMBER))


def test_slopes_are_differences_of_torques_also_where_a_process_replaces_the_links() -> None:
    model = random_model(ARTICULATED)
    assert model.residual_gp is not None
    assert model.residual_gp.replaces.any()
    arm, rng = Adaptation(model).arm, np.random.default_rng(1)
    states = rng.normal(size=(3, 4, model.n_joints))
    _, slopes = arm.linearised(arm.start, *states)
    for k, step in enumerate(1e-5 * np.eye(arm.start.size)):
        above, below = (arm.linearised(arm.start + s, *states)[0] for s in (step, -step))
        np.testing.assert_allclose(slopes[..., k], (above - below) / 2e-5, atol=1e-6)


@pytest.mark.parametrize('inflation', [None, np.nan])
def test_a_fit_that_knows_no_inflation_is_followed(inflation: float | None) -> None:
    model = replace(known_model(), summary={'covariance_inflation': inflation})
    followed = Adaptation(model).update(*stream(model, 5.0))
    assert followed.learned.all()
