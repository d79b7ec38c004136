"""The model file: npz with a JSON header, checked against a hash of both; no pickle."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import hashlib
import json
import os
from typing import Any, TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.errors import LipIdError, ModelError
from lip_id_ros.files import read_npz, write_npz
from lip_id_ros.kernels import (
    EnergyKernel,
    FAMILY,
    Friction,
    Hyperparameters,
    JointBasis,
    JointwiseKernel,
    Residual,
    TorqueKernel,
    TorquePrior,
    Weights,
)
from lip_id_ros.kernels.program import with_potential_after

if TYPE_CHECKING:
    from lip_id_ros.model.trained_model import TrainedModel

SCHEMA = 'lip_id_ros/model'
VERSION = 1

Arrays = dict[str, NDArray[Any]]


def write(path: str | os.PathLike[str], model: TrainedModel) -> None:
    """Write a model; see `TrainedModel.save`."""
    arrays = _arrays(model)
    header = {
        'schema': SCHEMA,
        'version': VERSION,
        'kernel': model.kernel,
        'potential_links': model.prior.kernel.energy.potential_links.tolist(),
        'joint_names': list(model.joint_names),
        'joint_types': list(model.joint_types),
        'jointwise': [kernel.name for kernel in model.prior.kernel.jointwise],
        'summary': dict(model.summary),
        'provenance': dict(model.provenance),
    }
    write_npz(path, arrays, {**header, 'sha256': _digest(arrays, header)})


def read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the arguments of `TrainedModel`; see `TrainedModel.load`."""
    try:
        arrays, header = read_npz(path)
    except ValueError as error:
        raise ModelError(
            f'{os.fspath(path)} is not a readable model file ({error}); '
            'fit again or copy the file anew.'
        ) from error
    _check(path, arrays, header)
    try:
        return _restore(arrays, header)
    except (KeyError, TypeError, ValueError, LipIdError) as error:
        raise ModelError(
            f'{os.fspath(path)} says it is a model but lacks or contradicts itself in {error}; '
            'fit again or copy the file anew.'
        ) from error


def _check(path: str | os.PathLike[str], arrays: Arrays, header: Mapping[str, Any]) -> None:
    if header.get('schema') != SCHEMA:
        raise ModelError(
            f'{os.fspath(path)} is not a model of lip_id_ros (its schema is '
            f'{header.get("schema")!r}, expected {SCHEMA!r}); pass the file that a fit wrote.'
        )
    if header.get('version') != VERSION:
        raise ModelError(
            f'{os.fspath(path)} has model format {header.get("version")!r}, but this program '
            f'reads format {VERSION}; fit again or use the version that wrote it.'
        )
    if header.get('sha256') != _digest(arrays, header):
        raise ModelError(
            f'{os.fspath(path)} is damaged: its contents do not match their hash; '
            'fit again or copy the file anew.'
        )


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
    terms = zip(prior.kernel.jointwise, prior.hyperparameters.jointwise, strict=True)
    for kernel, parameters in terms:
        arrays[f'{kernel.name}_parameters'] = parameters
        if isinstance(kernel, Friction):
            arrays['friction_sign_width'] = kernel.sign_width
        if isinstance(kernel, Residual):
            arrays['residual_scales'] = kernel.scales
    return arrays


def _restore(arrays: Arrays, header: Mapping[str, Any]) -> dict[str, Any]:
    types = tuple(str(kind) for kind in header['joint_types'])
    basis = JointBasis(types, arrays['basis_centre'], arrays['basis_half_range'])
    jointwise = tuple(_jointwise(name, basis, arrays) for name in header['jointwise'])
    kernel = TorqueKernel(_energy_kernel(header, len(types)), basis, jointwise)
    hyperparameters = Hyperparameters(
        weights=Weights(*(arrays[f'weights_{name}'] for name in Weights._fields)),
        jointwise=tuple(arrays[f'{name}_parameters'] for name in header['jointwise']),
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
    kernel = FAMILY[header['kernel']](n_joints)
    return with_potential_after(kernel, header['potential_links'])


def _jointwise(name: str, basis: JointBasis, arrays: Arrays) -> JointwiseKernel:
    makers: dict[str, Callable[[], JointwiseKernel]] = {
        'friction': lambda: Friction(arrays['friction_sign_width']),
        'residual': lambda: Residual(basis, arrays['residual_scales']),
    }
    return makers[name]()


def _digest(arrays: Arrays, header: Mapping[str, Any]) -> str:
    rest = {key: value for key, value in header.items() if key != 'sha256'}
    digest = hashlib.sha256(json.dumps(rest, sort_keys=True).encode())
    for name in sorted(arrays):
        digest.update(name.encode())
        digest.update(repr(arrays[name].shape).encode())
        digest.update(np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()
