"""Statistics of one recording: its own friction is eliminated, and nothing else is lost."""

from __future__ import annotations

from dataclasses import fields, replace
import pickle
from types import SimpleNamespace
from typing import Any

from fleet.fleets import arm_of, friction_of, linearisation_of, recording
from hypothesis import given, settings, strategies
import numpy as np
from numpy.testing import assert_allclose
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.fleet import model as fleet_model
from lip_id_ros.fleet.placements import PlacedArm
from lip_id_ros.fleet.results import Survey
from lip_id_ros.fleet.survey import gather_kept, survey_of
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.residual_gp_selection import ResidualProcess
from lip_id_ros.identification.sample_selection import measured
from lip_id_ros.identification.total import gather, RecordingFactors, unpacked
from lip_id_ros.rigid_body.chain import NO_COUPLINGS

ARM = arm_of()
FRICTION = friction_of(ARM, np.random.default_rng(0), 0.3)
DATA = recording(ARM, FRICTION, seed=1)
AROUND = linearisation_of(ARM, DATA)


def dense(data: Dataset, around: Linearisation) -> list[Array]:
    """Weighted rows [own friction, others, torque] of every joint."""
    features, target = around.rows(data)
    root = np.sqrt(around.noise.weights(data.dq))
    return [
        np.column_stack([each, target[:, joint]]) * root[:, joint, None]
        for joint, each in enumerate(features)
    ]


def factors(found: RecordingFactors) -> list[Array]:
    return [unpacked(found.triangles[0], AROUND, joint) for joint in range(AROUND.n_joints)]


def test_squares_are_those_of_all_samples() -> None:
    rng = np.random.default_rng(2)
    for factor, rows in zip(factors(gather(DATA, AROUND)), dense(DATA, AROUND), strict=True):
        x = np.append(rng.standard_normal(rows.shape[1] - 1), -1.0)
        assert_allclose(np.sum((factor @ x) ** 2), np.sum((rows @ x) ** 2), rtol=1e-11)


def test_the_rest_is_what_others_explain_with_the_best_friction() -> None:
    for joint, factor in enumerate(factors(gather(DATA, AROUND))):
        size, rows = AROUND.columns[joint][0].size, dense(DATA, AROUND)[joint]
        friction, others = rows[:, :size], rows[:, size:]
        projected = others - friction @ np.linalg.lstsq(friction, others, rcond=None)[0]
        expected = projected.T @ projected
        rest = factor[size:, size:]
        assert_allclose(rest.T @ rest, expected, atol=1e-10 * np.abs(expected).max())


@settings(max_examples=10, deadline=None)
@given(strategies.integers(1, 9))
def test_blocks_add_up_to_the_whole(count: int) -> None:
    whole, blocks = gather(DATA, AROUND), gather(DATA, AROUND, count)
    assert len(blocks.counts) == count
    assert_allclose(blocks.counts.sum(axis=0), whole.counts[0])
    for joint, factor in enumerate(factors(whole)):
        parts = unpacked(blocks.triangles, AROUND, joint)
        expected = factor.T @ factor
        found = np.einsum('bki,bkj->ij', parts, parts)
        assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


def test_bad_samples_are_left_out() -> None:
    tau = DATA.tau.copy()
    tau[[10, 200], 0] += 80.0 * DATA.tau.std()
    found = gather_kept(replace(DATA, tau=tau), AROUND)
    clean = np.setdiff1d(np.arange(DATA.n_samples), [10, 200])
    expected = gather(DATA.select(clean), AROUND)
    assert_allclose(found.counts, expected.counts)
    assert_allclose(found.triangles, expected.triangles, atol=1e-9)


def test_torques_of_drives_that_are_off_are_left_out() -> None:
    tau = DATA.tau.copy()
    tau[100:300] = 0.0
    off = replace(DATA, tau=tau)
    kept = np.flatnonzero(measured(off))
    assert not set(range(100, 300)) & set(kept)
    expected = gather(DATA.select(kept), AROUND)
    assert_allclose(gather_kept(off, AROUND).triangles, expected.triangles, atol=1e-9)
    assert np.all(survey_of(off, 'off', 'robot').tau.any(axis=1))


def test_a_recording_of_seven_joints_takes_less_than_300_kilobytes() -> None:
    arm = arm_of(1, ('revolute',) * 7)
    data = recording(arm, friction_of(arm, np.random.default_rng(0), 0.1), seed=1, count=3000)
    around = linearisation_of(arm, data)
    for kept in (gather_kept(data, around), survey_of(data, 'name', 'robot')):
        assert len(pickle.dumps(kept)) < 300_000
    assert len(around.friction.coefficients) == 21


def test_what_is_stored_comes_back() -> None:
    finding = {'code': 'slow', 'severity': 'warning', 'joint': 'a', 'text': 'a is slow.'}
    noted = {'sources': [{'source': 'log', 'findings': [finding]}]}
    survey = survey_of(replace(DATA, provenance=noted), 'name', 'robot')
    assert survey.health == ('warning slow: a is slow.',)
    back = Survey.from_bytes(survey.to_bytes())
    for name, value in vars(survey).items():
        np.testing.assert_array_equal(getattr(back, name), value)
        assert type(getattr(back, name)) is type(value)


@pytest.mark.parametrize('cut', [0, 10, 1000, -1])
def test_damaged_bytes_are_refused(cut: int) -> None:
    content = gather_kept(DATA, AROUND).to_bytes()
    with pytest.raises(DataError, match='a RecordingFactors with all of its entries was exp'):
        RecordingFactors.from_bytes(content[:cut])


def test_residuals_are_those_of_the_rows() -> None:
    """At the present parameters, of which steps of placements and widths are zero."""
    arm = arm_of(1, ('revolute', 'prismatic', 'revolute'))
    data = recording(arm, friction_of(arm, np.random.default_rng(0), 0.1), seed=1)
    around = linearisation_of(arm, data)
    now = np.zeros(around.size)
    now[: around.n_friction] = around.friction.coefficients
    now[-around.links.size :] = around.links.ravel()
    features, target = around.rows(data)
    for joint, (rows, own) in enumerate(zip(features, around.columns, strict=True)):
        found = target[:, joint] - rows @ now[np.concatenate(own)]
        assert_allclose(found, around.residual(data)[:, joint], atol=1e-10)


def test_processes_are_selected_by_the_recordings_that_placements_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A stored selection is known by these, so that none takes the place of one left out."""
    seen: list[int] = []

    def select(fitter: Any, *_: object) -> list[None]:
        seen.append(np.unique(fitter.dataset.recording).size)
        return [None] * fitter.dataset.n_joints

    monkeypatch.setattr('lip_id_ros.fleet.placements.MOST_RECORDINGS', 3)
    monkeypatch.setattr(fleet_model, 'select_processes', select)
    monkeypatch.setattr(fleet_model, '_fit', lambda *_: None)
    some: Any = [replace(survey_of(DATA, '', ''), key=key) for key in '0123']
    arm = {'joint_names': DATA.joint_names, 'couplings': NO_COUPLINGS}
    placed: Any = SimpleNamespace(**arm, excluded=[('0', '')], with_residual_gp=lambda _: placed)
    nothing: Any = None
    fleet_model.with_processes(placed, nothing, some)
    assert seen == [2]


def test_a_process_keeps_its_weight_in_a_placed_arm() -> None:
    """A process of half a weight was read again with its error as the weight."""
    values: dict[str, Any] = dict.fromkeys((each.name for each in fields(PlacedArm)), ())
    process = ResidualProcess(False, np.array([1.0, 2.0]), 0.1, weight=0.4, left_out_std=0.7)
    stored = PlacedArm(**values).with_residual_gp([process, None])
    found, nothing = stored.residual_gp
    assert nothing is None
    assert found is not None
    np.testing.assert_array_equal(found.lengths, process.lengths)
    assert (found.replaces, found.noise) == (False, 0.1)
    assert (found.weight, found.left_out_std) == (0.4, 0.7)
