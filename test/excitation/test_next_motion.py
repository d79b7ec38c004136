"""Motions that are designed for an arm that has been learned."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from excitation.cases import ARM, random_limits, random_posture, SEEDS
from hypothesis import given
import numpy as np
import pytest
from rigid_body.arms import random_bodies

import lip_id_ros as lip
from lip_id_ros.arrays import Array
from lip_id_ros.description.urdf import parse_description
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.arms import known_arm
from lip_id_ros.excitation.constraints import (
    DEVIATIONS,
    LARGEST_GROWTH,
    next_size,
    shrunk,
    TorqueLimits,
)
from lip_id_ros.excitation.expected_error import ExpectedError, States
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.planning import wanted_motions
from lip_id_ros.excitation.series import FourierMotion, LimitedMotions
from lip_id_ros.friction.basis import plain_friction
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.model.effort_calibration import EffortCalibration
from lip_id_ros.rigid_body.couplings import Coupling, rows_of

NAMES, TYPES = ('turn', 'lift', 'slide'), ('revolute', 'revolute', 'prismatic')
CALIBRATION = (EffortCalibration.identity(3),)
QUICK = lip.ExcitationConfig(
    lip.MotionSettings(duration_s=4.0, torque_limits=(1e4,), velocity=(2.0, 2.0, 0.5), size=1.0),
    lip.SpaceSettings(floor_m='none', self_distance_m='none'),
    lip.SearchSettings(draws=8),
)


@cache
def model() -> InverseDynamicsModel:
    """Return an arm whose links and friction are known to some tenths, its places better."""
    rng = np.random.default_rng(4)
    links = random_bodies(3, rng)
    basis = plain_friction(3, np.full(3, 0.1))
    friction = FrictionModel(basis, rng.uniform(0.2, 0.5, basis.size))
    sizes = [np.full(18, 0.01), 0.3 * np.abs(links).ravel() + 0.01, np.full(basis.size, 0.2)]
    chain = parse_description(ARM, 'arm.urdf', NAMES, TYPES).chain
    noise = TorqueNoise.constant(np.array([0.2, 0.2, 0.3]))
    arm = ArmPosterior(chain, links, friction, noise, np.diag(np.concatenate(sizes)))
    still = np.zeros((3, 3))
    return InverseDynamicsModel(
        NAMES, TYPES, np.zeros(3), (still, still), np.ones(3), 1, CALIBRATION, arm
    )


@cache
def found() -> lip.ExcitingMotion:
    return lip.design_motion(QUICK, ARM, model())


def test_a_model_is_taught_more_than_by_random_motions() -> None:
    assert found().joint_types == TYPES
    assert found().gain < 0.95


def test_what_is_expected_after_is_what_the_criterion_says() -> None:
    learning = found().learning
    assert learning is not None
    arm = model().arm
    assert arm is not None
    error = ExpectedError(known_arm(arm), learning.targets, learning.measurements)
    t = np.linspace(0.0, 4.0, 300, endpoint=False)
    shares = error.shares(found().motion.sample(t))
    before, after = learning.torque_std
    np.testing.assert_allclose((after / before) ** 2, shares, rtol=1e-3)
    assert np.all(learning.gravity_std[1] < learning.gravity_std[0] + 1e-12)
    np.testing.assert_array_equal(learning.after.predict(*ZERO).tau, model().predict(*ZERO).tau)


ZERO = np.zeros((3, 1, 3))


def test_noise_that_lasts_leaves_more_unknown() -> None:
    known = {'motion_s': 20.0, 'covariance_inflation': 20.0}
    lasting = replace(model(), n_samples=2000, summary=known)
    white, other = (lip.design_motion(QUICK, ARM, each).learning for each in (model(), lasting))
    assert white is not None
    assert other is not None
    assert (white.measurements, other.measurements) == (400.0, 20.0)
    assert np.all(other.torque_std[1] > 2.0 * white.torque_std[1])


def test_predicted_torques_keep_their_limits_with_three_deviations() -> None:
    free = used(found().motion, 1.0)
    tight = (*(0.6 * free).tolist(),)
    limits = np.array(tight)
    at_rest = np.abs(model().predict(*rest()).tau) + 3.0 * model().torque_std(*rest())
    assert np.all(at_rest < limits), 'the posture of this test must be possible'
    settings = replace(QUICK, motion=replace(QUICK.motion, torque_limits=tight))
    held = lip.design_motion(settings, ARM, model())
    shares = used(held.motion, limits)
    assert shares.max() <= 1.0
    assert shares.max() > 0.8
    assert held.gain < 1.0


def rest() -> np.ndarray:
    state = np.zeros((3, 1, 3))
    state[0] = found().motion.posture
    return state


def used(motion: FourierMotion, limits: np.ndarray | float) -> np.ndarray:
    """Return the largest shares of limits at 10 kHz, shape (n,)."""
    states = motion.sample(motion.times(1e4))
    size = np.abs(model().predict(*states).tau) + DEVIATIONS * model().torque_std(*states)
    return np.asarray((size / limits).max(axis=0))


@pytest.mark.parametrize('rate', [20.0, 50.0])
def test_torques_between_samples_are_bounded_by_those_at_them(rate: float) -> None:
    torques = TorqueLimits(model(), replace(found().limits, torque=np.ones(3)))
    assert np.all(torques.use(found().motion, rate) >= used(found().motion, 1.0))


def test_a_posture_that_cannot_be_held_is_refused() -> None:
    motion = replace(QUICK.motion, torque_limits=(1e4, 0.01, 1e4))
    with pytest.raises(lip.ConfigError, match=r"joint 'lift' needs .* more than its limit 0\.01;"):
        lip.design_motion(replace(QUICK, motion=motion), ARM, model())


def test_limits_that_leave_no_motion_are_refused() -> None:
    still = np.abs(model().predict(*rest()).tau) + DEVIATIONS * model().torque_std(*rest())
    nearly = 1.001 * still[0]
    motion = replace(QUICK.motion, torque_limits=(*nearly.tolist(),))
    with pytest.raises(lip.ConfigError, match=r'motion\.torque_limits must leave more than 1% of'):
        lip.design_motion(replace(QUICK, motion=motion), ARM, model())
    limits = replace(found().limits, torque=nearly)
    with pytest.raises(lip.ConfigError, match=r'motion\.torque_limits leave no motion at this'):
        next_size(model(), limits, found().motion.posture, 0.1)


def test_targets_are_states_of_a_data_set() -> None:
    rng = np.random.default_rng(3)
    q, dq, ddq = rng.uniform(0.1, 0.2, (3, 700, 3))
    data = lip.Dataset.from_arrays(q, dq, ddq, q, joint_names=NAMES[::-1], joint_types=TYPES[::-1])
    learning = lip.design_motion(QUICK, ARM, model(), data).learning
    assert learning is not None
    assert learning.targets[0].shape == (600, 3)
    np.testing.assert_array_equal(learning.targets[0][[0, -1]], q[[0, -1], ::-1])
    with pytest.raises(lip.DataError, match='targets of a motion must be a Dataset, not 3; use'):
        lip.design_motion(QUICK, ARM, model(), 3)  # type: ignore[arg-type]


def test_joints_are_those_of_the_model() -> None:
    motion = replace(QUICK.motion, joints=('turn', 'lift'))
    with pytest.raises(lip.ConfigError, match=r'must be those of the model, turn, lift, slide, '):
        lip.design_motion(replace(QUICK, motion=motion), ARM, model())


def test_a_slide_of_the_urdf_is_no_joint_that_the_model_turns() -> None:
    turned = replace(model(), joint_types=('revolute',) * 3)
    with pytest.raises(lip.DataError, match='types of the model, revolute, revolute, revolute, b'):
        lip.design_motion(QUICK, ARM, turned)


SPACE = lip.SpaceSettings(floor_m=0.1, margin_m=0.02, radius_m=0.03)
LIFTED = replace(QUICK.motion, posture=(0.0, 0.2, 0.3))


def test_a_floor_holds_where_the_model_has_coupled_positions() -> None:
    arm = model().arm
    assert arm is not None
    chain = arm.chain._replace(couplings=rows_of([Coupling(1, 0, 0.5)]))
    coupled = replace(model(), arm=replace(arm, chain=chain))
    found = lip.design_motion(replace(QUICK, motion=LIFTED, space=SPACE), ARM, coupled)
    # of the slide's end, whose arm lifts by half of the turn too
    assert heights(found, 0.5).min() >= 0.12
    assert found.extremes is not None
    assert found.extremes.lowest[1] == pytest.approx(heights(found, 0.5).min(), abs=2e-3)


def heights(found: lip.ExcitingMotion, coupling: float = 0.0) -> Array:
    """Return the heights of the end of `ARM`, which is 0.03 m thick, at 10 kHz."""
    q = found.motion.derivative(found.motion.times(1e4), 0)
    return np.asarray(0.27 - np.sin(q[:, 1] + coupling * q[:, 0]) * (0.2 + q[:, 2]))


def test_a_model_that_was_fitted_with_a_urdf_knows_where_its_links_are() -> None:
    motion = replace(LIFTED, lower=(-1.0, -1.0, 0.1), upper=(1.0, 1.5, 0.5))
    described = replace(model(), summary={'description': {'place': 'arm.urdf'}})
    found = lip.design_motion(replace(QUICK, motion=motion, space=SPACE), model=described)
    assert heights(found).min() >= 0.12
    assert found.unchecked.startswith('No shapes are at hand of turn, lift, slide: ')
    free = lip.design_motion(replace(QUICK, motion=motion), model=described)
    assert heights(free).min() < 0.12


def test_the_place_of_a_chain_that_torques_have_shown_is_not_taken_for_the_real_one() -> None:
    motion = replace(LIFTED, lower=(-1.0, -1.0, 0.0), upper=(1.0, 1.0, 0.6))
    found = lip.design_motion(replace(QUICK, motion=motion), model=model())
    assert found.clearance is None
    assert found.unchecked.startswith('Nobody has checked the floor and self-collision: no URDF')
    for space in (SPACE, lip.SpaceSettings(boxes=(0.0, 0.0, 0.0, 1.0, 1.0, 1.0))):
        with pytest.raises(lip.ConfigError, match='need a URDF, or a model that was fitted with'):
            lip.design_motion(replace(QUICK, motion=motion, space=space), model=model())


@given(SEEDS)
def test_smaller_limits_are_within_larger_ones(seed: int) -> None:
    rng = np.random.default_rng(seed)
    limits = random_limits(rng, 4)
    posture = random_posture(rng, limits)
    small, large = (shrunk(limits, posture, size) for size in np.sort(rng.uniform(0.1, 1.0, 2)))
    assert np.all((limits.lower <= large.lower) & (large.lower <= small.lower))
    assert np.all((small.lower < posture) & (posture < small.upper))
    assert np.all((small.upper <= large.upper) & (large.upper <= limits.upper + 1e-12))
    for little, much, most in zip(
        small.derivatives, large.derivatives, limits.derivatives, strict=True
    ):
        assert np.all((little <= much) & (much <= most))


def uncertain(factor: float) -> InverseDynamicsModel:
    arm = model().arm
    assert arm is not None
    return replace(model(), arm=replace(arm, covariance_root=factor * arm.covariance_root))


def limits_and_posture(share: float) -> tuple[JointLimits, Array]:
    """Return limits of torque that are a share of what large motions need."""
    limits, posture = found().limits, found().motion.posture
    wide = replace(limits, torque=np.ones(3))
    need = TorqueLimits(uncertain(0.0), wide).use(found().motion, 50.0)
    return replace(limits, torque=share * need), posture


def test_a_motion_grows_step_by_step_to_all_that_the_limits_allow() -> None:
    limits, posture = limits_and_posture(100.0)
    sizes = [0.15]
    while sizes[-1] < 1.0:
        sizes.append(next_size(model(), limits, posture, sizes[-1]))
        assert sizes[-1] <= LARGEST_GROWTH * sizes[-2]
    assert len(sizes) == 4


def test_less_certainty_gives_less_growth() -> None:
    limits, posture = limits_and_posture(0.8)
    sizes = [next_size(uncertain(x), limits, posture, 0.3) for x in (0.0, 0.1, 0.3)]
    assert 0.3 > sizes[0] > sizes[1] > sizes[2] > 0.0


def test_what_a_model_vouches_for_keeps_the_limits() -> None:
    limits, posture = limits_and_posture(0.8)
    size = next_size(uncertain(0.1), limits, posture, 0.1)
    assert 0.1 < size < 0.2
    motions = LimitedMotions(shrunk(limits, posture, size), posture, 20.0, 5)
    torques = TorqueLimits(uncertain(0.1), limits)
    rng = np.random.default_rng(0)
    for _ in range(12):
        assert torques.is_kept(motions.random(rng), fine=False)


def test_without_limits_of_torque_a_motion_doubles() -> None:
    limits, posture = limits_and_posture(1.0)
    assert next_size(model(), replace(limits, torque=None), posture, 0.2) == pytest.approx(0.4)
    assert next_size(model(), replace(limits, torque=None), posture, 0.9) == 1.0
    assert next_size(model(), replace(limits, torque=None), posture, 0.2, most=0.3) == 0.3


def test_a_posture_that_the_model_cannot_hold_is_refused() -> None:
    limits, posture = limits_and_posture(1.0)
    with pytest.raises(ConfigError, match='at the posture by the model, more than its limit'):
        next_size(uncertain(100.0), limits, posture, 0.3)


BOX = lip.TargetSettings(
    lower=(-0.5,), upper=(0.4,), velocity=(0.2,), acceleration=(0.3,), rate_hz=0.1
)


def test_torques_are_wanted_in_the_box_of_the_settings() -> None:
    motion = lip.design_motion(replace(QUICK, targets=BOX), ARM, model())
    assert motion.learning is not None
    q, dq, ddq = motion.learning.targets
    assert q.min() >= -0.5
    assert q.max() <= 0.4
    assert 0.1 < np.abs(dq).max() <= 0.2
    assert np.abs(ddq).max() <= 0.3
    # a box of slow motions is learned more surely from a motion that is designed for it
    expected = [
        np.mean(np.log(shares_after(each, motion.learning.targets))) for each in (motion, found())
    ]
    assert expected[0] < expected[1]


def shares_after(motion: lip.ExcitingMotion, targets: States) -> Array:
    arm = model().arm
    assert arm is not None
    error = ExpectedError(known_arm(arm), targets, 400.0)
    return error.shares(motion.motion.sample(np.linspace(0.0, 4.0, 300, endpoint=False)))


def test_wanted_motions_repeat_at_their_rate() -> None:
    limits = found().limits
    posture = 0.5 * (limits.lower + limits.upper)
    for rate, period in ((0.1, 10.0), ('motion', 4.0)):
        config = replace(QUICK, targets=replace(BOX, rate_hz=rate))
        wanted = wanted_motions(config, limits, posture)
        assert wanted.random(np.random.default_rng(0)).duration == pytest.approx(period)


def test_a_box_that_is_none_names_its_section() -> None:
    targets = replace(BOX, lower=(0.4,))
    with pytest.raises(ConfigError, match=r'correct targets\.lower and targets\.upper'):
        lip.design_motion(replace(QUICK, targets=targets), ARM, model())


def test_a_box_beside_a_recording_is_refused() -> None:
    q, dq, ddq, tau = np.zeros((4, 5, 3))
    still = lip.Dataset.from_arrays(q, dq, ddq, tau, joint_names=NAMES, joint_types=TYPES)
    with pytest.raises(ConfigError, match='both are given; leave one out'):
        lip.design_motion(replace(QUICK, targets=BOX), ARM, model(), still)


def test_inertias_are_as_sure_as_samples_of_the_arm_are() -> None:
    learning = found().learning
    assert learning is not None
    q, rng = learning.targets[0], np.random.default_rng(0)
    still = np.zeros_like(q)
    for row, known in enumerate((learning.before, learning.after)):
        arm = known.arm
        assert arm is not None
        rest = arm.jacobian_of_coordinates(q, still, still)
        rows = np.stack(
            [
                (arm.jacobian_of_coordinates(q, still, still + unit) - rest)[:, j]
                for j, unit in enumerate(np.eye(3))
            ]
        )
        root = arm.covariance_root
        draws = root @ rng.standard_normal((root.shape[1], 400))
        sampled = np.sqrt(np.mean((rows @ draws) ** 2, axis=(1, 2)))
        np.testing.assert_allclose(learning.inertia_std[row], sampled, rtol=0.15)
