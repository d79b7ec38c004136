"""What of a trained model goes into its file, and how it comes out again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import os
from typing import Any, TYPE_CHECKING

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
    TorquePrior,
    Weights,
)
from lip_id_ros.kernels.program import ENERGIES, with_potential_after
from lip_id_ros.model.checked_file import (
    Arrays,
    contradiction,
    MODEL,
    read_checked,
    write_checked,
)
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS

if TYPE_CHECKING:
    from lip_id_ros.model.trained_model import TrainedModel

VERSION = 2


def write(path: str | os.PathLike[str], model: TrainedModel) -> None:
    """Write a model; see `TrainedModel.save`."""
    header = {
        'kernel': model.prior.kernel.energy.name,
        'potential_links': model.prior.kernel.energy.potential_links.tolist(),
        'joint_names': list(model.joint_names),
        'joint_types': list(model.joint_types),
        'per_joint': [kernel.name for kernel in model.prior.kernel.per_joint],
        'rigid_links': bool(model.prior.kernel.links),
        'summary': dict(model.summary),
        'provenance': dict(model.provenance),
    }
    write_checked(path, MODEL, VERSION, _arrays(model), header)


def read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the arguments of `TrainedModel`; see `TrainedModel.load`."""
    arrays, header = read_checked(path, MODEL, VERSION)
    try:
        return _restore(arrays, header)
    except (KeyError, TypeError, ValueError, LipIdError) as error:
        raise contradiction(path, error) from error


def _arrays(model: TrainedModel) -> Arrays:
    prior = model.prior
    arrays: Arrays = {
        'q': model.states.q,
        'dq': model.states.dq,
        'ddq': model.states.ddq,
        'tau': model.tau,
        'alpha': model.alpha,
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


def _restore(arrays: Arrays, header: Mapping[str, Any]) -> dict[str, Any]:
    types = tuple(str(kind) for kind in header['joint_types'])
    basis = JointBasis(types, arrays['basis_centre'], arrays['basis_half_range'])
    per_joint = tuple(_per_joint(name, basis, arrays) for name in header['per_joint'])
    links = (_links(basis, arrays),) if header['rigid_links'] else ()
    kernel = TorqueKernel(_energy_kernel(header, len(types)), basis, per_joint, links)
    hyperparameters = Hyperparameters(
        weights=Weights(*(arrays[f'weights_{name}'] for name in Weights._fields)),
        per_joint=tuple(arrays[f'{name}_parameters'] for name in header['per_joint']),
        noise_variance=arrays['noise_variance'],
    )
    return {
        'joint_names': tuple(str(name) for name in header['joint_names']),
        'prior': TorquePrior(kernel, hyperparameters),
        'states': kernel.states(arrays['q'], arrays['dq'], arrays['ddq']),
        'tau': arrays['tau'],
        'alpha': arrays['alpha'],
        'summary': header['summary'],
        'provenance': header['provenance'],
    }


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
