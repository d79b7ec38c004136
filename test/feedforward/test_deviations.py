"""Standard deviations in a process of their own: the same numbers, and no harm when it ends."""

from __future__ import annotations

from pathlib import Path

from feedforward.arms import point
from model.models import random_model
import numpy as np
import psutil
import pytest
from waiting import suspend, wait_until

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError
from lip_id_ros.feedforward.deviations import Deviated, Deviations
from lip_id_ros.feedforward.loading import load_model, ModelFile
from lip_id_ros.feedforward.server import Server
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.signals.status import Level


def wait_for(deviations: Deviations) -> Deviated:
    done: list[Deviated] = []

    def taken() -> bool:
        done.extend(each for each in [deviations.take()] if each is not None)
        return bool(done)

    wait_until(taken, 'a standard deviation')
    return done[0]


def offer(deviations: Deviations, state: Array, tag: str, now: float) -> None:
    deviations.offer(state, tag, now, 0.1)


def process_of_deviations() -> psutil.Process:
    (found,) = (
        each
        for each in psutil.Process().children()
        if 'lip_id_ros.feedforward.deviations' in each.cmdline()
    )
    return found


@pytest.mark.slow
@pytest.mark.usefixtures('strange_modules')
def test_the_newest_reference_gets_its_standard_deviations(tmp_path: Path) -> None:
    model = random_model('recursive')
    path = str(tmp_path / 'model.npz')
    model.save(path)
    n = model.n_joints
    state = np.random.default_rng(2).normal(size=(3, n))
    deviations = Deviations(path, n)
    try:
        assert np.isinf(deviations.std(0.0, 0.1)).all()
        offer(deviations, state, 'first', 10.0)
        offer(deviations, state + 1, 'too soon', 10.01)
        done = wait_for(deviations)
        assert done.tag == 'first'
        expected = model.standard_deviation(*state[:, np.newaxis]).tau[0]
        np.testing.assert_allclose(done.std, expected, rtol=1e-9)
        np.testing.assert_array_equal(deviations.std(10.5, 0.1), done.std)
        assert np.isinf(deviations.std(12.0, 0.1)).all()  # of a reference long ago
        np.testing.assert_array_equal(deviations.std(12.0, 1.0), done.std)  # as often as asked for
        assert deviations.take() is None
        offer(deviations, state, 'second', 10.2)
        assert wait_for(deviations).tag == 'second'
    finally:
        deviations.stop()
    assert not deviations.alive
    offer(deviations, state, 'nobody', 20.0)
    assert deviations.take() is None


@pytest.mark.slow
def test_an_unknown_deviation_is_beyond_the_limit(tmp_path: Path) -> None:
    model = random_model('recursive')
    path = str(tmp_path / 'model.npz')
    model.save(path)
    settings = ServeSettings(
        accept_unproven=True,
        model_path=path,
        std_policy='zero',
        std_limits=(1e9,),
        ramp_s=0.0,
        range_policy='ignore',
    )
    arm = load_model(settings, ())
    assert arm.deviations is not None
    server = Server()
    server.use(arm, settings)
    server.enable()
    rest = [0.1] * model.n_joints
    points = [point(rest, rest, rest)]
    process = process_of_deviations()
    try:
        suspend(process)
        assert not server.sample(model.joint_names, points, 0.0).tau.any()  # not computed yet
        process.resume()
        wait_for(arm.deviations)
        assert server.sample(model.joint_names, points, 0.1).tau.all()
        assert server.judge('', 0.1)[0] == Level.WARN
        successor = load_model(settings, ())
        server.use(successor, settings)  # whose own are not computed yet
        try:
            assert server.sample(model.joint_names, points, 0.2).tau.all()
        finally:
            successor.stop()
            server.use(arm, settings)
    finally:
        arm.stop()
    assert not server.sample(model.joint_names, points, 9.0).tau.any()
    assert server.values()['uncertain'] == 2
    assert server.judge('', 9.0) == (
        Level.ERROR,
        'the process of the standard deviations has ended',
    )


def test_deviations_are_those_of_the_model_that_answers(tmp_path: Path) -> None:
    path = tmp_path / 'model.npz'
    first, second = random_model('recursive'), random_model('recursive', n_samples=9)
    first.save(path)
    file = ModelFile(str(path))
    second.save(tmp_path / 'second.npz')
    path.write_bytes((tmp_path / 'second.npz').read_bytes())  # in its place, as cp does
    model = file.load()
    deviations = Deviations(file.place, model.n_joints, [file.descriptor])
    state = np.random.default_rng(2).normal(size=(3, model.n_joints))
    try:
        offer(deviations, state, 'reference', 0.0)
        expected = first.standard_deviation(*state[:, np.newaxis]).tau[0]
        np.testing.assert_allclose(wait_for(deviations).std, expected, rtol=1e-9)
        np.testing.assert_array_equal(model.query(*state).tau, first.query(*state).tau)
    finally:
        deviations.stop()
        file.close()


@pytest.mark.slow
def test_a_process_that_cannot_begin_is_an_error(tmp_path: Path) -> None:
    path = str(tmp_path / 'absent.npz')
    with pytest.raises(ModelError, match=r'process that computes them ended or was not ready w'):
        Deviations(path, 2)


@pytest.mark.slow
def test_a_process_that_never_begins_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('lip_id_ros.feedforward.deviations.LONGEST_START_S', 1e-3)
    path = str(tmp_path / 'model.npz')
    random_model('recursive').save(path)
    with pytest.raises(ModelError, match=r'was not ready within 0.001 s'):
        Deviations(path, random_model('recursive').n_joints)
