"""Identification with known kinematics."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from simulation.panda_runs import runs

from benchmarks._arms import JointFriction
from benchmarks.baselines import method
from benchmarks.baselines.rigid_body import RigidBody
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation import metrics
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.progress import silent
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation.arm import panda_urdf

pytest.importorskip('pinocchio')

SETTINGS = FitSettings()
FRICTION = JointFriction(np.array([2.0, 1.0, 0.5]), np.array([3.0, 2.0, 1.0]))


def test_it_finds_torques_and_energies_exactly() -> None:
    data, unseen = runs(3, 100, FRICTION)
    rotor = np.array([0.3, 0.2, 0.1])
    data, unseen = (replace(d, tau=d.tau + rotor * d.ddq + 0.7) for d in (data, unseen))
    learned = method('rigid_body', panda_urdf()).fit(data, SETTINGS, silent)
    found = learned.predict(unseen.q, unseen.dq, unseen.ddq)
    np.testing.assert_allclose(found.tau, unseen.tau, atol=1e-6)
    assert found.kinetic is not None
    assert found.potential is not None
    assert unseen.kinetic is not None
    assert unseen.potential is not None
    kinetic = unseen.kinetic + 0.5 * np.square(unseen.dq) @ rotor
    # an offset on joint 1 and the first link's potential energy are apart, T is whole
    np.testing.assert_allclose(found.kinetic, kinetic, atol=1e-5 * kinetic.max())
    assert metrics.nmse_percent_without_offset(found.potential, unseen.potential) < 5


def test_selected_friction_beside_true_kinematics() -> None:
    """Any axes of the URDF are those of the chain; what drives really have is selected."""
    data, unseen = runs(3, 400, FRICTION)
    extra = [5.0 * d.dq * np.abs(d.dq) * [1.0, 0.0, 0.0] for d in (data, unseen)]
    data, unseen = (replace(d, tau=d.tau + e) for d, e in zip((data, unseen), extra, strict=True))
    learned = method('rigid_body_friction', panda_urdf()).fit(data, SETTINGS, silent)
    assert isinstance(learned, RigidBody)
    assert isinstance(learned.friction, FrictionModel)
    found = learned.predict(unseen.q, unseen.dq, unseen.ddq)
    # the simulated sign jumps, the selected one is smooth
    assert metrics.nmse_percent(found.tau, unseen.tau).max() < 0.5
    assert 'quadratic viscous' in learned.friction.names()[0]


@pytest.mark.parametrize('name', ['rigid_body', 'rigid_body_friction', 'semiparametric'])
def test_joints_out_of_order_are_refused(name: str) -> None:
    data, _ = runs(3, 60, FRICTION)
    other = data.with_joints(data.joint_names[::-1])
    with pytest.raises(DataError, match='name the joints of one serial arm from base to tip'):
        method(name, panda_urdf()).fit(other, SETTINGS, silent)


def test_without_gravity_in_the_torques_there_is_none_in_the_model() -> None:
    data, _ = runs(2, 40)
    bare = replace(data, gravity_compensated=True)
    learned = method('rigid_body', panda_urdf()).fit(bare, SETTINGS, silent)
    potential = learned.predict(data.q, data.dq, data.ddq).potential
    assert potential is not None
    assert np.ptp(potential) == 0


def test_a_noisy_joint_does_not_spoil_the_others() -> None:
    data, unseen = runs(3, 100)
    noise = np.random.default_rng(0).standard_normal(data.tau.shape) * [50.0, 0.01, 0.01]
    learned = method('rigid_body', panda_urdf()).fit(
        replace(data, tau=data.tau + noise), SETTINGS, silent
    )
    found = learned.predict(unseen.q, unseen.dq, unseen.ddq).tau
    assert metrics.nmse_percent(found, unseen.tau)[1:].max() < 0.01


def test_semiparametric_learns_what_the_regressor_has_not() -> None:
    data, unseen = runs(2, 150)
    data, unseen = (replace(d, tau=d.tau + 5 * np.sin(3 * d.q)) for d in (data, unseen))
    errors = {}
    for name in ('rigid_body', 'semiparametric'):
        learned = method(name, panda_urdf()).fit(data, SETTINGS, silent)
        found = learned.predict(unseen.q, unseen.dq, unseen.ddq).tau
        errors[name] = metrics.nmse_percent(found, unseen.tau)
    assert np.all(errors['semiparametric'] < 0.3 * errors['rigid_body'])
