"""Torques of a plan beside limits, and the time in which it fits."""

from __future__ import annotations

from adaptation.arms import known_model
from hypothesis import given
from hypothesis import strategies as st
from nodes import toy
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward.interpolation import Plan
from lip_id_ros.feedforward.plan_check import (
    _least_scale,
    check_plan,
    fitting_scale,
    MOST_LOOKS,
    MOST_WATCHED,
    SLOWEST,
    STEP_S,
)
from lip_id_ros.model import InverseDynamicsModel

WAY = np.array([0.8, -0.6])


def plan(seconds: float = 1.0, start: float = 0.0) -> Plan:
    """From rest to rest: one segment of degree 5, whose largest acceleration is known."""
    states = np.zeros((3, 2, 2))
    states[0] = start, start
    states[0, 1] += WAY
    return Plan(toy.JOINTS, np.array([0.0, seconds]), states)


LARGEST_ACCELERATION = 10.0 / np.sqrt(3.0) * np.abs(WAY)  # of the plan in a second


def inertial(q: Array, dq: Array, ddq: Array, t: Array) -> Array:
    return toy.INERTIA * ddq


def full(q: Array, dq: Array, ddq: Array, t: Array) -> Array:
    return toy.torque(q, ddq)


@given(st.floats(0.05, 0.95), st.integers(0, 1))
def test_the_scale_is_the_root_of_the_excess(share: float, joint: int) -> None:
    limits = 10.0 * toy.INERTIA * LARGEST_ACCELERATION
    limits[joint] *= 0.1 * share
    found = fitting_scale(inertial, plan(), limits)
    assert found == pytest.approx(share**-0.5, rel=2e-3)


@given(st.floats(0.3, 1.5))
def test_the_scale_fits_and_a_smaller_one_does_not(share: float) -> None:
    limits = toy.WEIGHT + share * toy.INERTIA
    made = plan(0.4)
    scale = fitting_scale(full, made, limits)
    assert scale is not None

    def excess(factor: float) -> float:
        t, (q, dq, ddq) = made.slowed(factor).motion(factor * STEP_S)
        return float((np.abs(full(q, dq, ddq, t)) - limits).max())

    assert excess(scale) <= 0.01  # N m, between the samples
    assert excess(0.99 * scale) > 0.0


def test_no_scale_helps_where_gravity_is_too_much() -> None:
    assert fitting_scale(full, plan(start=1.0), 0.5 * toy.WEIGHT) is None
    assert fitting_scale(inertial, plan(), np.full(2, 1e-6)) is None  # beyond `SLOWEST`
    limits = toy.INERTIA * LARGEST_ACCELERATION / (0.9 * SLOWEST) ** 2
    assert fitting_scale(inertial, plan(), limits) == pytest.approx(0.9 * SLOWEST, rel=2e-3)


@given(st.integers(0, 10**6), st.floats(0.05, 0.9), st.floats(0.0, 3.0))
def test_a_search_on_few_samples_finds_what_one_on_all_does(
    seed: int, share: float, friction: float
) -> None:
    """With friction that falls with speed."""

    def torques(q: Array, dq: Array, ddq: Array, t: Array) -> Array:
        return toy.torque(q, ddq) + friction * np.exp(-5.0 * np.abs(dq)) * np.sign(dq) + dq

    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.05, 1.0, 30))
    q = np.cumsum(rng.normal(0.0, 0.3, (30, 2)), axis=0)
    dq = np.gradient(q, t, axis=0)
    made = Plan(toy.JOINTS, t, np.array([q, dq, np.gradient(dq, t, axis=0)]))
    motion = made.motion(STEP_S)
    assert len(motion.t) > 2 * MOST_WATCHED
    way, velocity, acceleration = motion.states
    largest = np.abs(torques(way, velocity, acceleration, motion.t)).max(axis=0)
    limits = toy.WEIGHT + friction + share * largest
    if (largest > limits).any():
        assert fitting_scale(torques, made, limits) == _least_scale(torques, motion, limits, 1.0)


def test_all_samples_of_a_long_plan_are_looked_at_a_few_times() -> None:
    looks: list[int] = []

    def counted(q: Array, dq: Array, ddq: Array, t: Array) -> Array:
        looks.append(len(t))
        return inertial(q, dq, ddq, t)

    limits = 0.2e-6 * toy.INERTIA * LARGEST_ACCELERATION
    found = fitting_scale(counted, plan(seconds=1000.0), limits)
    assert found == pytest.approx(0.2**-0.5, rel=2e-3)
    long = [n for n in looks if n > 10_000]
    assert 2 <= len(long) <= MOST_LOOKS + 1
    assert sum(looks) - sum(long) < len(looks) * 4 * MOST_WATCHED * MOST_LOOKS


@pytest.fixture(scope='module')
def model(tmp_path_factory: pytest.TempPathFactory) -> InverseDynamicsModel:
    return InverseDynamicsModel.load(toy.model_path(tmp_path_factory))


def test_loads_of_each_joint(model: InverseDynamicsModel) -> None:
    made = plan(0.5)
    t, states = made.motion(STEP_S)
    expected = toy.torque(states[0], states[2])
    largest = np.abs(expected).max(axis=0)
    found = check_plan(model, made, [0.8 * largest[0], 1.2 * largest[1]])
    assert not found.fits
    assert found.duration_s == pytest.approx(0.5, abs=1e-5)
    shoulder, elbow = found.loads
    assert (shoulder.joint, elbow.joint) == toy.JOINTS
    np.testing.assert_allclose([abs(shoulder.tau), abs(elbow.tau)], largest, rtol=0.05)
    row = int(np.abs(expected[:, 0]).argmax())
    assert shoulder.at_s == pytest.approx(t[row], abs=0.03)
    assert shoulder.excess == abs(shoulder.tau) - shoulder.limit > 0.0
    assert any(begin <= shoulder.at_s <= end for begin, end in shoulder.beyond_s)
    beyond = np.abs(expected[:, 0]) > shoulder.limit
    seconds = sum(end - begin for begin, end in shoulder.beyond_s)
    assert seconds == pytest.approx(STEP_S * np.count_nonzero(beyond), abs=0.05)
    assert (elbow.beyond_s, elbow.excess) == ((), 0.0)
    assert 0.0 < shoulder.std < 1.0


def test_a_plan_in_its_fitting_time_fits(model: InverseDynamicsModel) -> None:
    limits = [9.0, 4.0]
    found = check_plan(model, plan(0.5), limits)
    assert found.scale is not None
    assert found.scale > 1.0
    slower = check_plan(model, plan(0.5).slowed(found.scale), limits)
    assert slower.fits
    assert all(load.excess == 0.0 for load in slower.loads)


def test_deviations_keep_torques_away_from_limits(model: InverseDynamicsModel) -> None:
    (first, second), made = check_plan(model, plan(0.5), [1e6]).loads, plan(0.5)
    limits = [abs(first.tau) + 2.0 * first.std, abs(second.tau) + 1e3]
    assert check_plan(model, made, limits).fits
    assert check_plan(model, made, limits, sigmas=1.0).fits
    strict = check_plan(model, made, limits, sigmas=10.0)
    assert not strict.fits
    assert strict.loads[0].beyond_s
    assert strict.loads[0].excess == 0.0  # by the mean alone


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_plan_in_its_fitting_time_stays_deviations_away_from_limits(
    model: InverseDynamicsModel, sign: float
) -> None:
    made, sigmas = plan(0.5), 20.0
    made = Plan(made.joint_names, made.t, sign * made.states)
    loads = check_plan(model, made, [1e6]).loads
    limits = [0.8 * abs(load.tau) + sigmas * load.std for load in loads]
    found = check_plan(model, made, limits, sigmas=sigmas)
    assert found.scale is not None
    assert found.scale > 1.0
    slower = check_plan(model, made.slowed(found.scale), limits, sigmas=sigmas)
    for load in slower.loads:
        assert abs(load.tau) + sigmas * load.std <= (1.0 + 1e-6) * load.limit


def test_joints_may_come_in_another_order(model: InverseDynamicsModel) -> None:
    made = plan()
    turned = Plan(made.joint_names[::-1], made.t, made.states[:, :, ::-1])
    assert check_plan(model, turned, [5.0, 2.0]) == check_plan(model, made, [5.0, 2.0])


@pytest.mark.parametrize('limits', [[], [0.0, 1.0], [np.nan, 1.0], [1.0, 1.0, 1.0]])
def test_limits_are_one_per_joint(model: InverseDynamicsModel, limits: list[float]) -> None:
    with pytest.raises(ConfigError, match='limits'):
        check_plan(model, plan(), limits)


def test_friction_is_that_of_drives() -> None:
    """A recording's low-pass softens friction at reversals, and no drive does."""
    model = known_model()
    way = np.stack([np.zeros(3), np.full(3, 0.6)])
    made = Plan(model.joint_names, np.array([0.0, 0.8]), np.stack([way, 0 * way, 0 * way]))
    recorded = model.with_rise_time(0.2)
    assert check_plan(recorded, made, [1e3]).loads == check_plan(model, made, [1e3]).loads
    t, (q, dq, ddq) = made.motion(STEP_S)
    difference = model.predict(q, dq, ddq, t).tau - recorded.predict(q, dq, ddq, t).tau
    assert np.abs(difference).max() > 0.1
