"""The coefficients of friction: each with its joint, term, unit and deviation."""

from __future__ import annotations

from dataclasses import replace

from export.arms import model_of, random_arm
from friction.test_terms import EVERY
import numpy as np
import pytest

from lip_id_ros.export.friction_table import (
    coefficients_of,
    friction_curves,
    friction_table,
    labels,
)
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.terms import saturating, stribeck, Term


@pytest.mark.parametrize('term', EVERY, ids=lambda term: term.name)
def test_every_term_names_its_coefficients(term: Term) -> None:
    assert len(coefficients_of(term)) == len(term.lower)


def test_widths_are_velocities_of_the_joint() -> None:
    assert coefficients_of(saturating(0.01))[0] == ('within 0.03 rad/s', 'N m')
    assert coefficients_of(stribeck(0.03, 0.04))[1] == ('within 0.5 rad/s', 'N m')
    basis = FrictionBasis(1, (DriveTerm(Drive.of_joint(0), saturating(0.01)),))
    assert labels(basis, ['lift'], ['prismatic'])[2] == (
        *('lift', 'saturating viscous, within 0.3 m/s', 'N'),
    )


def test_units_are_those_of_the_joint() -> None:
    table = friction_table(model_of(random_arm('RPR')))
    units = {(each.joint, each.term): each.unit for each in table}
    assert units['joint_1', 'viscous'] == 'N m s/rad'
    assert units['joint_2', 'viscous'] == 'N s/m'
    assert units['joint_2', 'Coulomb'] == 'N'
    assert units['joint_3', 'quadratic viscous'] == 'N m s²/rad²'
    assert ('joint_2', 'torque coupled with joint_3') in units


def test_values_and_deviations_are_those_of_the_posterior() -> None:
    model = model_of(random_arm('RRR'))
    assert model.arm is not None
    friction = model.arm.friction
    std = np.random.default_rng(0).uniform(0.1, 1.0, friction.basis.size)
    root = np.diag(np.concatenate([np.zeros(3 * 17), std]))
    table = friction_table(replace(model, arm=replace(model.arm, covariance_root=root)))
    order = np.argsort([owner(part) for part in friction.basis.terms], kind='stable')
    rows = np.concatenate(
        [np.arange(friction.basis.size)[friction.basis.slices[k]] for k in order]
    )
    np.testing.assert_array_equal([each.value for each in table], friction.coefficients[rows])
    assert [each.std for each in table] == pytest.approx(std[rows])
    joints = [model.joint_names.index(each.joint) for each in table]
    assert joints == sorted(joints)


def test_a_coefficient_that_the_covariance_leaves_out_has_no_deviation() -> None:
    model = model_of(random_arm('RRR'))
    assert model.arm is not None
    root = np.zeros((3 * 17 + model.arm.friction.basis.size, 1))
    for each in friction_table(replace(model, arm=replace(model.arm, covariance_root=root))):
        assert each.std is None
        assert each.cells()[2] == f'{each.value:.4g}'


def test_the_terms_of_a_joint_add_up_to_its_friction() -> None:
    model = model_of(random_arm('RRR'))
    velocity = np.linspace(-1.0, 1.0, 7)
    dq = np.zeros((7, 3))
    dq[:, 1] = velocity
    curves = friction_curves(model, 'joint_2', velocity)
    viscous = next(
        each.value
        for each in friction_table(model)
        if (each.joint, each.term) == ('joint_2', 'viscous')
    )
    np.testing.assert_allclose(dict(curves)['viscous'], viscous * velocity)
    total = np.sum([curve for _, curve in curves], axis=0)
    np.testing.assert_allclose(total, model.friction(dq)[:, 1], atol=1e-12)


def owner(part: DriveTerm) -> int:
    return part.drive.efforts[0][0]
