"""Parts of models as arrays and JSON, for model files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import os
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import LipIdError, ShapeError
from lip_id_ros.kernels import (
    EnergyKernel,
    Friction,
    Hyperparameters,
    JointBasis,
    PerJointKernel,
    Residual,
    RigidLinks,
    TorqueKernel,
    TorquePosterior,
    TorquePrior,
    Weights,
)
from lip_id_ros.kernels.program import ENERGIES, with_potential_after
from lip_id_ros.model.checked_file import Arrays, contradiction
from lip_id_ros.model.effort_calibration import EffortCalibration
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS


@contextmanager
def contradictions(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raise ModelError where contents do not fit together."""
    try:
        yield
    except (KeyError, TypeError, ValueError, LipIdError) as error:
        raise contradiction(path, error) from error


def finite(values: Any, names: Sequence[str]) -> Array:
    """
    Return one finite number per joint.

    Raises
    ------
    ValueError
        If there are others.

    """
    array = np.array(values, dtype=np.float64)
    if array.shape != (len(names),) or not np.isfinite(array).all():
        raise ValueError(f'numbers for {len(names)} joints that are not: {values}')
    return array


def calibrations_to_json(calibrations: Sequence[EffortCalibration]) -> list[dict[str, Any]]:
    """Return effort calibrations for a header."""
    return [{'scale': x.scale.tolist(), 'offset': x.offset.tolist()} for x in calibrations]


def calibrations_from_json(
    entries: Sequence[Mapping[str, Any]], names: Sequence[str]
) -> tuple[EffortCalibration, ...]:
    """Return the effort calibrations that `calibrations_to_json` gave; ValueError if damaged."""
    if not entries:
        raise ValueError('effort_calibrations, of which there are none')
    return tuple(
        EffortCalibration(finite(entry['scale'], names), finite(entry['offset'], names))
        for entry in entries
    )


def process_to_json(process: TorquePosterior) -> dict[str, Any]:
    """Return what of a Gaussian process posterior goes into a header."""
    kernel = process.prior.kernel
    return {
        'kernel': kernel.energy.name,
        'potential_links': kernel.energy.potential_links.tolist(),
        'joint_types': list(kernel.basis.joint_types),
        'per_joint': [term.name for term in kernel.per_joint],
        'rigid_links': bool(kernel.links),
    }


def process_to_arrays(process: TorquePosterior) -> Arrays:
    """Return the arrays of a Gaussian process posterior."""
    prior = process.prior
    arrays: Arrays = {
        'q': process.states.q,
        'dq': process.states.dq,
        'ddq': process.states.ddq,
        'tau': process.tau,
        'alpha': process.alpha,
        'noise_variance': prior.hyperparameters.noise_variance,
        'basis_centre': prior.kernel.basis.centre,
        'basis_half_range': prior.kernel.basis.half_range,
    }
    for name, values in zip(Weights._fields, prior.hyperparameters.weights, strict=True):
        arrays[f'weights_{name}'] = values
    terms = zip(prior.kernel.per_joint, prior.hyperparameters.per_joint, strict=True)
    for kernel, parameters in terms:
        arrays[f'{kernel.name}_parameters'] = parameters
        if isinstance(kernel, Friction):
            arrays['friction_sign_width'] = kernel.sign_width
        if isinstance(kernel, Residual):
            arrays['residual_scales'] = kernel.scales
    for links in prior.kernel.links:
        arrays['links_rotations'] = links.chain.rotations
        arrays['links_translations'] = links.chain.translations
        arrays['links_gravity'] = links.chain.gravity
        arrays['links_deviations'] = links.deviations
    return arrays


def process_from(arrays: Arrays, header: Mapping[str, Any], n_joints: int) -> TorquePosterior:
    """
    Return the Gaussian process posterior of arrays and header.

    Raises
    ------
    KeyError, TypeError, ValueError, LipIdError
        If they contradict each other.

    """
    types = tuple(str(kind) for kind in header['joint_types'])
    if len(types) != n_joints:
        raise ShapeError(f'{len(types)} joint types for {n_joints} joints')
    basis = JointBasis(types, arrays['basis_centre'], arrays['basis_half_range'])
    per_joint = tuple(_per_joint(name, basis, arrays) for name in header['per_joint'])
    links = (_links(basis, arrays),) if header['rigid_links'] else ()
    kernel = TorqueKernel(_energy_kernel(header, len(types)), basis, per_joint, links)
    hyperparameters = Hyperparameters(
        weights=Weights(*(arrays[f'weights_{name}'] for name in Weights._fields)),
        per_joint=tuple(arrays[f'{name}_parameters'] for name in header['per_joint']),
        noise_variance=arrays['noise_variance'],
    )
    states = kernel.states(arrays['q'], arrays['dq'], arrays['ddq'])
    for name in ('tau', 'alpha'):
        if arrays[name].shape != states.q.shape:
            raise ShapeError(f'{name} of shape {arrays[name].shape} for {states.q.shape}')
    prior = TorquePrior(kernel, hyperparameters)
    return TorquePosterior(prior, states, arrays['tau'], arrays['alpha'])


def _energy_kernel(header: Mapping[str, Any], n_joints: int) -> EnergyKernel:
    kernel = ENERGIES[header['kernel']](n_joints)
    return with_potential_after(kernel, header['potential_links'])


def _per_joint(name: str, basis: JointBasis, arrays: Arrays) -> PerJointKernel:
    makers: dict[str, Callable[[], PerJointKernel]] = {
        'friction': lambda: Friction(arrays['friction_sign_width']),
        'residual': lambda: Residual(basis, arrays['residual_scales']),
    }
    return makers[name]()


def _links(basis: JointBasis, arrays: Arrays) -> RigidLinks:
    n = len(basis.joint_types)
    shapes = {
        'links_rotations': (n, 3, 3),
        'links_translations': (n, 3),
        'links_gravity': (3,),
        'links_deviations': (n, LINK_PARAMETERS),
    }
    for name, shape in shapes.items():
        if arrays[name].shape != shape:
            raise ShapeError(f'{name} of shape {arrays[name].shape} where {shape} was expected')
    rotations, translations, gravity, deviations = (arrays[name] for name in shapes)
    chain = Chain(rotations, translations, basis.prismatic, gravity)
    return RigidLinks(chain, deviations)
