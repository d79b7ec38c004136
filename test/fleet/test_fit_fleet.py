"""A fit to a small fleet: the same whatever runs it, and robust against what does not belong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import re

from fleet.fleets import (
    arm_of,
    FileSource,
    friction_of,
    friction_torque,
    PlainEngine,
    recording,
    save,
    WIDTH,
)
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.evaluation import fit_cautions
from lip_id_ros.export.arm import describe
from lip_id_ros.export.urdf import to_urdf
from lip_id_ros.fleet.engines import LocalEngine
from lip_id_ros.fleet.fit import fit_fleet
from lip_id_ros.fleet.results import EXCLUDED, FAILED, FITTED, FleetResult
from lip_id_ros.identification.fitting import fit
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body.couplings import Coupling, couplings_of, rows_of
from lip_id_ros.settings import Config, FitSettings

ARM, OTHER = arm_of(), arm_of(seed=8)
ROBOTS, PER_ROBOT = 5, 2

EPISODE = r'([\d.]+) to [\d.]+ s of (\S+\.npz)'

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group('fleet')]


class Fleet:
    def __init__(self, folder: Path) -> None:
        rng = np.random.default_rng(0)
        self.folder, self.sources, self.data = folder, list[FileSource](), list[Dataset]()
        for robot in range(ROBOTS):
            friction = friction_of(ARM, rng, 0.3)
            for number in range(PER_ROBOT):
                own = friction * (1.0 + 0.03 * rng.standard_normal(friction.shape))
                data = recording(ARM, own, 10 * robot + number, 400 + 100 * (not self.data))
                self.data.append(data)
                turned = data.with_joints(data.joint_names[::-1])
                stored = turned if len(self.data) == 4 else data  # in another order
                self.add(stored, f'{robot}_{number}', f'robot {robot}')
        self.good = len(self.sources)
        for number in range(2):
            strange = recording(OTHER, friction_of(OTHER, rng, 0.3), seed=900 + number)
            self.add(strange, f'other_{number}', 'robot 0')
        (folder / 'poison.npz').write_bytes(b'nothing')
        self.sources.append(FileSource(str(folder / 'poison.npz'), 'robot 1'))
        self.add(self.data[0], 'copy', 'robot 4')
        self.cache, self.engine = dict[str, bytes](), PlainEngine()
        self.begun: list[str] = []
        self.result = fit_fleet(self.sources, Config(), self.engine, self.cache, self.report)

    def report(self, stage: str, done: int, total: int) -> None:
        if done == 0:
            self.begun.append(stage)

    def add(self, data: Dataset, name: str, group: str) -> None:
        self.sources.append(save(data, self.folder / f'{name}.npz', group))


@pytest.fixture(scope='module')
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Fleet:
    return Fleet(tmp_path_factory.mktemp('fleet'))


def parameters(result: FleetResult) -> Array:
    arm = result.model.arm
    assert arm is not None
    parts = arm.chain.rotations, arm.chain.translations, arm.links, arm.friction.coefficients
    return np.concatenate([each.ravel() for each in parts])


def test_what_does_not_belong_is_named_with_the_reason(fleet: Fleet) -> None:
    status = [each.status for each in fleet.result.recordings]
    assert status[: fleet.good] == [FITTED] * fleet.good
    assert status[fleet.good :] == [EXCLUDED, EXCLUDED, FAILED, EXCLUDED]
    *strange, poison, copy = (each.reason for each in fleet.result.recordings[fleet.good :])
    for reason in strange:
        assert reason.startswith('contradicts the other recordings: its residual at joint_')
        assert 'times the median of 10 recordings' in reason
    assert 'poison.npz is not a data set' in poison
    assert copy == f'is a copy of {fleet.sources[0].name}'


def test_ranges_are_those_of_the_joints_whatever_the_order_of_a_recording(fleet: Fleet) -> None:
    model = fleet.result.model
    states = np.hstack([[each.q, each.dq, each.ddq] for each in fleet.data])
    low, high = model.training_range
    assert_allclose(low, states.min(axis=1))
    assert_allclose(high, states.max(axis=1))
    largest = np.abs(np.concatenate([each.tau for each in fleet.data])).max(axis=0)
    assert_allclose(model.largest_torque, largest)
    assert_allclose(model.potential_reference, states[0].mean(axis=0))


def test_every_stage_begins_once(fleet: Fleet) -> None:
    assert len(fleet.begun) == 4  # of two identifications; this engine does not announce passes
    assert len(set(fleet.begun)) == len(fleet.begun)


def test_order_and_processes_do_not_matter(fleet: Fleet) -> None:
    with LocalEngine(2) as engine:
        other = fit_fleet(fleet.sources[::-1], Config(), engine)
    assert_array_equal(parameters(other), parameters(fleet.result))
    names = [each.name for each in other.recordings]
    assert names == [each.name for each in fleet.result.recordings][::-1]


def test_recordings_that_are_known_are_not_read_again(fleet: Fleet) -> None:
    engine = PlainEngine()
    again = fit_fleet(fleet.sources, Config(), engine, fleet.cache)
    assert engine.counts == [0, 0]  # the poison is not tried again
    reasons = [each.reason for each in again.recordings]
    assert reasons == [each.reason for each in fleet.result.recordings]
    assert_array_equal(parameters(again), parameters(fleet.result))
    for name, values in vars(again.recordings[3]).items():
        assert_array_equal(values, getattr(fleet.result.recordings[3], name))


def test_friction_of_robots_is_recovered(fleet: Fleet) -> None:
    result = fleet.result
    assert result.model.joint_names == fleet.data[0].joint_names
    first = [
        f'joint_0: {name}' for name in ('viscous [N m s/rad]', 'Coulomb [N m]', 'offset [N m]')
    ]
    assert list(result.friction_names[:3]) == first
    between = result.deviation_of_groups.reshape(-1, 3)
    expected = 0.3 * np.tile([0.3, 0.8, 0.2], (2, 1))
    # Coulomb friction, of five robots; viscous friction and offsets are known less well
    assert_allclose(between[:, 1], expected[:, 1], rtol=0.8)
    assert np.all(result.deviation_of_recordings < 0.3 * np.maximum(between, 0.05).ravel() + 0.05)
    assert_allclose(result.noise_std, 0.02, rtol=0.3)
    for each in result.recordings[: fleet.good]:
        assert_allclose(each.residual_rms, 0.02, rtol=0.3)
        assert np.all(each.friction_std > 0.0)


def test_a_fleet_predicts_links_better_than_a_fit_to_all_recordings(fleet: Fleet) -> None:
    joined = fit(concatenate(fleet.data))
    unseen = recording(ARM, np.zeros((2, 3)), seed=12345)
    assert link_error(fleet.result.model, unseen) < 0.5 * link_error(joined, unseen)
    assert link_error(fleet.result.model, unseen) < 0.01 * unseen.tau.std()


def link_error(model: InverseDynamicsModel, data: Dataset) -> float:
    """Root mean square error of torques of the links, but for an offset."""
    assert data.tau_noiseless is not None
    found = model.predict(data.q, data.dq, data.ddq)
    error = found.tau - found.friction - data.tau_noiseless
    return float(np.sqrt(np.mean((error - error.mean(axis=0)) ** 2)))


def test_links_that_explain_all_but_friction_have_no_process_beside_them(fleet: Fleet) -> None:
    assert fleet.result.model.residual_gp is None


def test_deviations_cover_a_robot_that_was_not_seen(fleet: Fleet) -> None:
    rng = np.random.default_rng(77)
    data = concatenate(
        [recording(ARM, friction_of(ARM, rng, 0.3), seed=5000 + k, count=60) for k in range(30)]
    )
    assert data.tau_noiseless is not None
    found = fleet.result.model.predict(data.q, data.dq, data.ddq, return_std=True)
    assert found.std is not None
    ratio = (found.tau - data.tau_noiseless) / found.std.tau
    assert 0.3 < np.sqrt(np.mean(ratio**2)) < 1.7


def test_deviations_of_one_fit_and_of_a_fleet_agree(tmp_path: Path) -> None:
    """With each other, and with the errors, where recordings differ by noise alone."""
    arm = arm_of(0, ('revolute',) * 4)
    friction = friction_of(arm, np.random.default_rng(0), 0.0)
    data = [recording(arm, friction, k, count=800) for k in range(4)]
    sources = [save(each, tmp_path / f'{k}.npz', '') for k, each in enumerate(data)]
    fleet = fit_fleet(sources, Config(), PlainEngine()).model.arm
    single = fit(concatenate(data)).arm
    assert fleet is not None
    assert single is not None
    unseen = recording(arm, friction, 999)
    state = unseen.q, unseen.dq, unseen.ddq
    stds = [np.sqrt(np.mean(each.torque_std(*state) ** 2, axis=0)) for each in (fleet, single)]
    assert unseen.tau_noiseless is not None
    error = fleet.torque(*state) - unseen.tau_noiseless
    assert_allclose(stds[0], stds[1], rtol=0.4)
    assert np.mean(np.abs(error) < 2.0 * fleet.torque_std(*state)) > 0.8


def test_the_model_is_saved_and_read(fleet: Fleet, tmp_path: Path) -> None:
    model = fleet.result.model
    model.save(tmp_path / 'fleet.npz')
    back = InverseDynamicsModel.load(tmp_path / 'fleet.npz')
    data = fleet.data[0]
    motion = data.q, data.dq, data.ddq
    assert_allclose(back.predict(*motion).tau, model.predict(*motion).tau, atol=1e-12)
    assert back.summary['recordings'] == fleet.good
    assert len(back.provenance['sources']) == fleet.good
    assert back.summary['contradicting_recordings'] is None


def test_a_description_whose_inertials_have_changed_is_another(
    fleet: Fleet, tmp_path: Path
) -> None:
    """The file keeps its name, and its joints their places."""
    arm, file = describe(fleet.result.model, 'arm').arm, tmp_path / 'arm.urdf'
    settings = FitSettings(description=str(file), description_inertial=0.01, terms='friction')
    cache, config = dict[str, bytes](), Config(fit=settings)
    file.write_text(to_urdf(replace(arm, links=2.0 * arm.links)))
    fit_fleet(fleet.sources[:2], config, PlainEngine(), cache)
    file.write_text(to_urdf(arm))
    corrected, anew = (
        fit_fleet(fleet.sources[:2], config, PlainEngine(), each) for each in (cache, {})
    )
    assert_array_equal(parameters(corrected), parameters(anew))


def test_a_solution_that_is_not_linear_is_found_in_one_more_pass(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('lip_id_ros.identification.posterior.LINEAR', -1.0)
    sources = []
    for number in range(5):
        data = recording(ARM, np.tile([0.3, 0.8, 0.2], (2, 1)), seed=number)
        load = ARM.torque(data.q, data.dq, data.ddq)
        gear = 0.3 * np.abs(load) * np.tanh(data.dq / WIDTH)
        loaded = replace(data, tau=data.tau + gear, tau_noiseless=None)
        sources.append(save(loaded, tmp_path / f'{number}.npz', 'robot'))
    engine = PlainEngine()
    result = fit_fleet(sources, Config(), engine)
    assert any('load-dependent' in name for name in result.friction_names)
    assert [count for count in engine.counts if count] == [5, 5, 5]  # others were kept
    for each in result.recordings:
        assert np.all(each.residual_rms < 0.04)


def test_an_episode_of_contact_is_told_with_the_name_of_its_recording(tmp_path: Path) -> None:
    sources, friction = [], friction_of(ARM, np.random.default_rng(0), 0.0)
    touched = {'run_0': 4.0, 'run_2': 12.0}
    for number in range(3):
        data, name = recording(ARM, friction, seed=40 + number, count=1000), f'run_{number}'
        push = np.abs(data.t - touched.get(name, -9.0) - 1.0) < 1.0
        data = replace(data, tau=data.tau + 3.0 * push[:, np.newaxis] * data.tau.std(axis=0))
        sources.append(save(data, tmp_path / f'{name}.npz', ''))
    model = fit_fleet(sources, Config(), PlainEngine()).model
    (text,) = [each for each in fit_cautions(model) if 'contradict the rest' in each]
    begins = {Path(name).stem: float(begin) for begin, name in re.findall(EPISODE, text)}
    # what a push leaves in the fit may contradict the rest elsewhere as well
    for name, begin in touched.items():
        assert begins[name] == pytest.approx(begin, abs=0.6)


def test_nothing_to_read_is_refused(fleet: Fleet) -> None:
    poison = fleet.sources[fleet.good + 2]
    with pytest.raises(DataError, match='at least one recording that can be read is needed'):
        fit_fleet([poison], Config(), PlainEngine())


def test_other_kernels_are_refused(fleet: Fleet) -> None:
    config = Config(fit=FitSettings(kernel='lip'))
    with pytest.raises(ConfigError, match=r'a fit recording by recording needs fit\.kernel'):
        fit_fleet(fleet.sources, config, PlainEngine())


TYPES = ('revolute',) * 3
COUPLING = Coupling(2, 1, -1.0)


@pytest.mark.slow
@pytest.mark.xdist_group('fleet')
@pytest.mark.parametrize('texts', [(), ('joint_2 -1 joint_1',)])
def test_coupled_positions_of_several_recordings(texts: tuple[str, ...], tmp_path: Path) -> None:
    serial, rng = arm_of(3, TYPES), np.random.default_rng(0)
    arm = replace(serial, chain=serial.chain._replace(couplings=rows_of((COUPLING,))))
    friction = friction_of(arm, rng, 0.3)
    sources = [
        save(recording(arm, friction, seed), tmp_path / f'{seed}.npz', f'robot {seed}')
        for seed in range(4)
    ]
    model = fit_fleet(sources, Config(fit=FitSettings(coupling=texts)), PlainEngine()).model
    assert model.arm is not None
    assert couplings_of(model.arm.chain.couplings) == (COUPLING,)
    test = recording(arm, friction, 99)
    found = model.predict(test.q, test.dq, test.ddq, return_std=True)
    tau = arm.torque(test.q, test.dq, test.ddq) + friction_torque(friction, test.dq)
    errors = np.sqrt(np.mean((found.tau - tau) ** 2, axis=0))
    assert (errors < 0.02 * tau.std(axis=0)).all()
    assert found.std is not None
    assert (np.abs(found.tau - tau) < 3.0 * found.std.tau).mean() > 0.95
