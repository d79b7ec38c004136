"""Friction terms are selected where they are, and not where they are not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from identification.drives import (
    coupled,
    coupled_efforts,
    JOINT,
    LINK_STD,
    N_JOINTS,
    NOISE,
    PLAIN,
    PRESENT,
    present,
    recording,
    Terms,
    WIDTH,
)
import numpy as np
import pytest

from benchmarks._arms import random_arm, RandomArm
from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.terms import coulomb, load_coulomb, load_viscous
from lip_id_ros.identification.friction_candidates import Candidate
from lip_id_ros.identification.friction_selection import (
    _Ballot,
    select_friction,
    SelectedFriction,
)
from lip_id_ros.identification.friction_shapes import (
    FIRST,
    LAST,
    resolved_harmonics,
    strongest_harmonic,
)
from lip_id_ros.identification.left_out import LeftOutFit
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples

pytestmark = pytest.mark.slow

SEEDS = (0, 1)


def selected(arm: RandomArm, dataset: Dataset) -> tuple[SelectedFriction, list[set[str]]]:
    got = select_friction(dataset, arm.chain, LINK_STD)
    return got, [set(names) - PLAIN for names in got.friction.names()]


def error(arm: RandomArm, dataset: Dataset, got: SelectedFriction) -> Array:
    state = dataset.q, dataset.dq, dataset.ddq
    links = RandomArm(arm.chain, got.link_parameters).torque(*state)
    tau = links + got.friction.torque(dataset.q, dataset.dq, dataset.ddq, links)
    assert dataset.tau_noiseless is not None
    off = np.sqrt(np.mean((tau - dataset.tau_noiseless) ** 2, axis=0))
    return np.asarray(off / (NOISE * arm.torque(*state).std(axis=0)))


@cache
def plain(seed: int) -> tuple[RandomArm, Dataset, SelectedFriction]:
    """Return an arm with nothing but the usual friction, and what is selected for it."""
    arm, dataset = recording(seed, [])
    return arm, dataset, selected(arm, dataset)[0]


def check(extra: Terms, expected: list[set[str]], seeds: Sequence[int] = SEEDS) -> None:
    others = 0
    for seed in seeds:
        arm, dataset = recording(seed, extra)
        got, names = selected(arm, dataset)
        assert all(there <= mine for mine, there in zip(names, expected, strict=True))
        others += sum(map(len, names)) - sum(map(len, expected))
        assert np.all(error(arm, dataset, got) < 1.0)
    assert others <= 1


@pytest.mark.parametrize(('number', 'name'), enumerate(PRESENT))
def test_selected_where_it_is(number: int, name: str) -> None:
    """One term beside the usual ones, of two arms in turn."""
    expected = [{name} if joint == JOINT else set() for joint in range(N_JOINTS)]
    check(present(name), expected, [number % 2])


@pytest.mark.parametrize('seed', SEEDS)
def test_rounding_selects_nothing(seed: int) -> None:
    """Load-dependent viscous friction that would be negative is zero, and gains nothing."""
    arm, dataset = recording(seed, present('load-dependent Coulomb'))
    tau, load = dataset.tau.copy(), arm.torque(dataset.q, dataset.dq, dataset.ddq)
    tau[:, JOINT] -= 0.05 * np.abs(load[:, JOINT]) * dataset.dq[:, JOINT]
    rng = np.random.default_rng(seed)
    for rounding in 0.0, 1e-10:
        changed = tau * (1.0 + rounding * rng.standard_normal(tau.shape))
        _, names = selected(arm, replace(dataset, tau=changed))
        assert names == [set(), {'load-dependent Coulomb'}, set()]


def dahl(q: Array, dq: Array, torque: float, displacement: float) -> Array:
    """Return the friction of Dahl (1968) along a motion, shape (N,)."""
    friction, out = 0.0, np.zeros_like(q)
    for k in range(1, len(q)):
        goal = torque * np.sign(dq[k])
        friction = goal + (friction - goal) * np.exp(-abs(q[k] - q[k - 1]) / displacement)
        out[k] = friction
    return out


@pytest.mark.parametrize('seed', SEEDS)
def test_friction_with_a_memory_is_presliding(seed: int) -> None:
    arm, dataset = recording(seed, [])
    extra = dahl(
        dataset.q[:, JOINT], dataset.dq[:, JOINT], 0.3 * dataset.tau[:, JOINT].std(), 0.03
    )
    tau = dataset.tau.copy()
    tau[:, JOINT] += extra
    _, names = selected(arm, replace(dataset, tau=tau))
    assert [each & {'pre-sliding'} for each in names] == [set(), {'pre-sliding'}, set()]


def test_coupled_motors() -> None:
    pair = [{f'{term} coupled with joint {k}' for term in ('viscous', 'Coulomb')} for k in (3, 2)]
    check(coupled(), [set(), *pair])


def test_torques_of_coupled_motors() -> None:
    check(coupled_efforts(), [set(), {'torque coupled with joint 3'}, set()])


def test_nothing_is_selected_where_there_is_nothing() -> None:
    check([], [set()] * N_JOINTS)


def test_sticking_near_rest_spoils_nothing() -> None:
    arm, dataset, clean = plain(0)
    near = np.abs(dataset.dq) < 0.1
    rng = np.random.default_rng(1)
    size = arm.torque(dataset.q, dataset.dq, dataset.ddq).std(axis=0)
    off = np.where(near, 0.3 * size * rng.choice([-1.0, 1.0], near.shape), 0.0)
    got, names = selected(arm, replace(dataset, tau=dataset.tau + off))
    assert names == [set()] * N_JOINTS
    assert np.all(got.noise.ratio >= 4.0)
    assert np.all(error(arm, dataset, got) < 1.0)
    np.testing.assert_array_equal(clean.noise.ratio, 0.0)


def test_a_joint_that_nothing_explains_spoils_no_other() -> None:
    arm, dataset, clean = plain(0)
    tau = dataset.tau.copy()
    walk = np.cumsum(np.random.default_rng(2).standard_normal(dataset.n_samples))
    tau[:, 2] += 2.0 * tau[:, 2].std() * walk / walk.std()
    spoilt, _ = selected(arm, replace(dataset, tau=tau))
    before, after = (error(arm, dataset, got)[:2] for got in (clean, spoilt))
    assert np.all(after < 1.5 * before)


def with_spikes(dataset: Dataset) -> tuple[Dataset, BoolArray]:
    rng = np.random.default_rng(9)
    bad = rng.random(dataset.tau.shape) < 0.02
    off = 10.0 * dataset.tau.std(axis=0) * rng.choice([-1.0, 1.0], bad.shape)
    return replace(dataset, tau=dataset.tau + np.where(bad, off, 0.0)), bad


def with_absurd_accelerations(dataset: Dataset) -> tuple[Dataset, BoolArray]:
    bad = np.arange(dataset.n_samples) % 200 == 0
    ddq = np.where(bad[:, None], 100.0 * dataset.ddq, dataset.ddq)
    return replace(dataset, ddq=ddq), np.broadcast_to(bad[:, None], ddq.shape)


@pytest.mark.parametrize('spoil', [with_spikes, with_absurd_accelerations])
def test_bad_samples_change_little(
    spoil: Callable[[Dataset], tuple[Dataset, BoolArray]],
) -> None:
    arm, dataset, clean = plain(0)
    bad_dataset, bad = spoil(dataset)
    got, names = selected(arm, bad_dataset)
    assert names == [set()] * N_JOINTS
    assert np.all(error(arm, dataset, got) < 1.1 * error(arm, dataset, clean) + 0.01)
    weights = got.weights(bad_dataset, arm.chain)
    assert np.mean(weights[~bad] > 0.9) > 0.99
    assert np.median(weights[bad]) < 0.01


@pytest.mark.parametrize('width', [0.037, 0.084])
def test_widths_are_found_between_those_of_the_grid(
    width: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Other terms would make up for a wrong width, with errors that no deviation shows."""
    monkeypatch.setattr('identification.drives.WIDTH', width)
    monkeypatch.setattr('identification.drives.NOISE', 0.005)
    for seed in SEEDS:
        arm, dataset = recording(seed, [])
        got, names = selected(arm, dataset)
        assert names == [set()] * N_JOINTS
        terms = (part.term for part in got.friction.basis.terms)
        found = [term.parameters['width'] for term in terms if term.kind is coulomb]
        np.testing.assert_allclose(found, width, rtol=0.08)


def test_a_joint_that_is_slow_has_a_wide_sign() -> None:
    """Wider than dry friction is as a rule, where the samples show it for sure."""
    arm, dataset = recording(0, [])
    speed = np.sqrt(np.mean(dataset.dq**2, axis=0))
    width = 0.3 * float(speed[0])
    change = np.tanh(dataset.dq[:, 0] / width) - np.tanh(dataset.dq[:, 0] / WIDTH)
    tau = dataset.tau.copy()
    tau[:, 0] += 0.1 * arm.torque(dataset.q, dataset.dq, dataset.ddq)[:, 0].std() * change
    got, names = selected(arm, replace(dataset, tau=tau))
    assert names == [set()] * N_JOINTS
    first = next(p.term for p in got.friction.basis.terms if p.term.kind is coulomb)
    np.testing.assert_allclose(first.parameters['width'], width, rtol=0.1)


def filtered(arm: RandomArm, speed: float, rate_hz: float = 200.0) -> Dataset:
    """Record a motion with dry friction whose sign is sharp, low-passed as usual."""
    t = np.arange(0.0, 60.0, 1.0 / rate_hz)
    w = speed * 2.0 * np.pi * np.array([[0.11, 0.23, 0.31], [0.07, 0.29, 0.17]])
    size = np.array([0.8, 0.5])
    phase = np.multiply.outer(t, w)
    q = np.einsum('k,tkj->tj', size, np.sin(phase))
    dq = np.einsum('k,tkj->tj', size, w * np.cos(phase))
    ddq = np.einsum('k,tkj->tj', size, -(w**2) * np.sin(phase))
    links = arm.torque(q, dq, ddq)
    tau = links + np.sign(dq)
    return preprocess(JointSamples(t, q, dq, tau, ('a', 'b', 'c')))


@pytest.mark.parametrize('seed', SEEDS)
def test_what_the_low_pass_makes_of_friction_is_no_friction(seed: int) -> None:
    """Friction is learned from reversals that it blurs, and holds at other speeds."""
    arm = random_arm(N_JOINTS, seed)
    usual = filtered(arm, 1.0)
    fits = [
        select_friction(dataset, arm.chain, LINK_STD)
        for dataset in (usual, replace(usual, provenance={}))
    ]
    for speed, bound in ((0.5, 0.8), (2.0, 0.5)):
        other, errors = filtered(arm, speed), []
        state = other.q, other.dq, other.ddq
        for got in fits:
            links = RandomArm(arm.chain, got.link_parameters).torque(*state)
            torque = links + got.friction.torque(*state, links)
            errors.append(np.sqrt(np.mean((torque - other.tau) ** 2, axis=0)))
        assert np.all(errors[0] < bound * errors[1])


def sweep(reach: float, count: int = 3000) -> Array:
    t = np.linspace(0.0, 1.0, count)
    return reach * np.sin(7.0 * t) * np.sin(2.9 * t + 0.3)


@given(harmonic=st.integers(FIRST, 200), phase=st.floats(0.0, 6.0), seed=st.integers(0, 100))
def test_the_strongest_harmonic(harmonic: int, phase: float, seed: int) -> None:
    """Half as large as the noise, and next to other features that are a hundred times as large."""
    rng, q = np.random.default_rng(seed), sweep(3.0)
    root = rng.uniform(0.5, 1.0, q.size)
    features = root[:, None] * np.column_stack([np.cos(q), np.sin(q), q, np.ones_like(q)])
    torque = np.cos(harmonic * q + phase) + 2.0 * rng.standard_normal(q.size)
    torque = root * torque + features @ (100.0 * rng.standard_normal(4))
    harmonics = np.arange(FIRST, LAST + 1)
    assert abs(strongest_harmonic(q, torque, features, harmonics) - harmonic) <= 1


def test_harmonics_of_which_the_recording_shows_a_period() -> None:
    _, dataset = recording(0, [])
    q = np.tile(sweep(0.25)[:960, None], N_JOINTS)
    slow = replace(dataset, q=q)
    found = resolved_harmonics(slow, JOINT)
    assert found[0] == np.ceil(2.0 * np.pi / np.ptp(q[:, JOINT]))
    assert found[-1] == LAST
    fast = resolved_harmonics(dataset, JOINT)
    step = np.median(np.abs(np.diff(dataset.q[:, JOINT])))
    assert fast[0] == FIRST
    assert fast[-1] < LAST
    assert fast[-1] * step < 0.5 * np.pi


def test_a_prismatic_joint_has_no_turns() -> None:
    _, dataset = recording(0, [])
    sliding = replace(dataset, joint_types=('prismatic',) * N_JOINTS)
    assert resolved_harmonics(sliding, JOINT).size == 0


class Known:
    """Left-out errors of what is taken, and of every candidate beside it."""

    def __init__(self, *squares: Array) -> None:
        self._fits = [LeftOutFit(np.zeros(1), (), (each,)) for each in squares]

    def noise(self, _: IndexArray) -> Array:
        return np.ones(1)

    def fit(self, *_: Array) -> LeftOutFit:
        return LeftOutFit(np.zeros(1), (), (np.ones((8, 1)),))

    def explained(self, _: IndexArray, groups: list[IndexArray], *__: Array) -> Array:
        return np.full(len(groups), 1e3)

    def with_each(self, *_: Any) -> list[LeftOutFit]:
        return self._fits


@pytest.mark.parametrize(
    ('better', 'other_joint', 'chosen'), [(0.01, 0, 0), (0.2, 0, 1), (0.01, 1, 1)]
)
def test_of_terms_that_predict_equally_well_the_usual_one_is_taken(
    better: float, other_joint: int, chosen: int
) -> None:
    """Unless another is better by more than chance, or is of another joint."""
    usual = 0.5 + 0.1 * np.array([[1.0, -1.0] * 4]).T
    chance = 0.05 * np.array([[1.0, 1.0, -1.0, -1.0] * 2]).T
    offers = [
        Candidate((DriveTerm(Drive.of_joint(joint), term),))
        for joint, term in ((0, load_coulomb(0.1)), (other_joint, load_viscous()))
    ]
    groups = [np.array([1]), np.array([2])]
    blocks = Known(usual, usual - better + chance)
    ballot = _Ballot(blocks, np.array([0]), groups, offers)  # type: ignore[arg-type]
    assert ballot.best_addition([], range(2)) == chosen
