"""Parts of models as arrays and JSON, for model files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
import os
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.checked_file import Arrays, contradiction
from lip_id_ros.errors import LipIdError, ShapeError
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.joint_types import is_prismatic, JOINT_TYPES
from lip_id_ros.kernels import (
    EnergyKernel,
    FAMILY,
    FrictionKernel,
    Hyperparameters,
    JointBasis,
    TorqueKernel,
    TorquePosterior,
    TorquePrior,
    Weights,
)
from lip_id_ros.kernels.program import unit_weights, with_potential_after
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.model.effort_calibration import EffortCalibration
from lip_id_ros.model.known_states import KnownStates
from lip_id_ros.model.residual_gp import Inputs, ResidualGP
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.chain import NO_COUPLINGS, ROTOR
from lip_id_ros.rigid_body.couplings import contradiction as contradiction_of
from lip_id_ros.rigid_body.couplings import couplings_of, rows_of
from lip_id_ros.rigid_body.pseudo_inertia import pseudo_inertia
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

RESIDUAL_GP = ('x', 'lengths', 'noise', 'variance', 'left_out_std', 'alpha', 'friction')
CONTRADICTIONS = (AttributeError, IndexError, KeyError, TypeError, ValueError, LipIdError)
NOISE = ('std', 'ratio', 'velocity', 'stuck', 'width')
KNOWN_STATES = ('known_states', 'known_scale', 'known_left_out')
INPUTS = ('centre', 'scale', 'sign_width')

LARGEST = 1e9
"""No number of an arm is larger, in SI units."""

ROUNDING = 1e-6
"""Of rotations, and of pseudo-inertias relative to their largest eigenvalue."""


@contextmanager
def contradictions(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raise ModelError where contents do not fit together."""
    try:
        yield
    except CONTRADICTIONS as error:
        raise contradiction(path, error) from error


def finite(values: Any, types: Sequence[str]) -> Array:
    """Return one finite number per joint; ValueError if there are others."""
    array = np.array(values, dtype=np.float64)
    if array.shape != (len(types),) or not np.isfinite(array).all():
        raise ValueError(f'numbers for {len(types)} joints that are not: {values}')
    return array


def joint_types(values: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """Return the types of the joints; ValueError if there is not one for each joint."""
    types = tuple(str(kind) for kind in values)
    if len(types) != len(names) or not set(types) <= set(JOINT_TYPES):
        raise ValueError(f'{len(types)} joint types for {len(names)} joints')
    return types


def training_range(arrays: Arrays, types: Sequence[str]) -> tuple[Array, Array]:
    """Return the range of the training samples; ValueError if it is of no arm or another."""
    expect(arrays, {name: (3, len(types)) for name in ('training_low', 'training_high')})
    low, high = arrays['training_low'], arrays['training_high']
    require(bool((low <= high).all()), 'training_low, which lies above training_high')
    return low, high


def expect(arrays: Arrays, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Raise an error where an array has another shape, or holds no real numbers."""
    for name, shape in shapes.items():
        dtype = arrays[name].dtype
        if arrays[name].shape != shape:
            raise ShapeError(f'{name} of shape {arrays[name].shape} where {shape} was expected')
        if dtype.kind not in 'fu' or not dtype.isnative:
            raise TypeError(f'{name}, which holds {dtype} where real numbers were expected')


def require(holds: bool, what: str) -> None:
    """Raise ValueError with what is wrong with the contents of a file unless a condition holds."""
    if not holds:
        raise ValueError(what)


def require_positive(arrays: Arrays, *names: str, zero: bool = False) -> None:
    """Raise ValueError where an array has a number below zero, or one that is `zero`."""
    for name in names:
        lowest = np.min(arrays[name], initial=np.inf)
        require(lowest >= 0.0 if zero else lowest > 0.0, f'{name}, with {lowest:g} in it')


def calibrations_to_json(calibrations: Sequence[EffortCalibration]) -> list[dict[str, Any]]:
    """Return effort calibrations for a header."""
    return [{'scale': x.scale.tolist(), 'offset': x.offset.tolist()} for x in calibrations]


def calibrations_from_json(
    entries: Sequence[Mapping[str, Any]], types: Sequence[str]
) -> tuple[EffortCalibration, ...]:
    """Return the effort calibrations that `calibrations_to_json` gave; ValueError if damaged."""
    if not entries:
        raise ValueError('effort_calibrations, of which there are none')
    return tuple(
        EffortCalibration(finite(entry['scale'], types), finite(entry['offset'], types))
        for entry in entries
    )


def put_arm(arm: ArmPosterior, arrays: Arrays) -> dict[str, Any]:
    """Add the arrays of an arm; return its entry in the header."""
    chain, noise = arm.chain, arm.noise
    coordinates = np.flatnonzero(arm.covariance_root.any(axis=1))
    arrays |= {
        'arm_rotations': chain.rotations,
        'arm_translations': chain.translations,
        'arm_gravity': chain.gravity,
        'arm_couplings': chain.couplings,
        'arm_links': arm.links,
        'arm_noise': np.stack(np.broadcast_arrays(*(getattr(noise, name) for name in NOISE))),
        'arm_coordinates': coordinates.astype(np.uint16),
        'arm_covariance_root': arm.covariance_root[coordinates].astype(np.float32),
    }
    return {'friction': arm.friction.to_json()}


def arm_from(arrays: Arrays, entry: Mapping[str, Any], types: Sequence[str]) -> ArmPosterior:
    """
    Return an arm.

    KeyError, TypeError, ValueError, LipIdError if its parts contradict each other.
    """
    n, coordinates = len(types), arrays['arm_coordinates']
    couplings = arrays['arm_couplings']
    friction = FrictionModel.from_json(entry['friction'])
    if friction.n_joints != n:
        raise ShapeError(f'friction of {friction.n_joints} joints for {n}')
    expect(
        arrays,
        {
            'arm_rotations': (n, 3, 3),
            'arm_translations': (n, 3),
            'arm_gravity': (3,),
            'arm_couplings': (len(couplings), 3),
            'arm_links': (n, LINK_PARAMETERS),
            'arm_noise': (len(NOISE), n),
            'arm_coordinates': (coordinates.size,),
            'arm_covariance_root': (coordinates.size, arrays['arm_covariance_root'].shape[1]),
        },
    )
    _require_possible(arrays, coordinates)
    size = (DIRECTIONS + LINK_PARAMETERS) * n + friction.basis.with_shapes().size
    columns = arrays['arm_covariance_root'].shape[1]  # of an array that may have no rows
    require(columns <= size, f'arm_covariance_root, with {columns} columns for {size} parameters')
    root = np.zeros((size, columns))
    root[coordinates] = arrays['arm_covariance_root']
    places = arrays['arm_rotations'], arrays['arm_translations']
    chain = Chain(*places, is_prismatic(types), arrays['arm_gravity'], _couplings(couplings, n))
    noise = TorqueNoise(*arrays['arm_noise'])
    return ArmPosterior(chain, arrays['arm_links'], friction, noise, root)


def _couplings(rows: Array, n_joints: int) -> Array:
    """Return couplings that fit together; ValueError where they do not."""
    found = couplings_of(rows)
    problem = contradiction_of(found, n_joints)
    require(not problem, f'arm_couplings, with {problem}')
    return rows_of(found)


def _require_possible(arrays: Arrays, coordinates: IndexArray) -> None:
    """Raise ValueError where numbers are those of no arm."""
    turn, links = arrays['arm_rotations'], arrays['arm_links']
    for name in (name for name in arrays if name.startswith('arm_')):
        largest = np.max(np.abs(arrays[name]), initial=0.0)
        require(bool(largest <= LARGEST), f'{name}, with {largest:g} in it')
    error = np.abs(turn @ np.swapaxes(turn, 1, 2) - np.eye(3)).max()
    require(error < ROUNDING and bool((np.linalg.det(turn) > 0.0).all()),
            'arm_rotations, which are not all rotations')  # fmt: skip
    moments = np.linalg.eigvalsh(pseudo_inertia(links[:, :ROTOR]))
    require(
        bool((moments[:, 0] >= -ROUNDING * moments[:, -1]).all() and (links[:, ROTOR] >= 0).all()),
        'arm_links, of which some cannot exist',
    )
    require_positive(arrays, 'arm_noise', zero=True)
    velocities = arrays['arm_noise'][[NOISE.index('velocity'), NOISE.index('width')]]
    require(bool((velocities > 0.0).all()), 'arm_noise, with a velocity of zero')
    require(len(np.unique(coordinates)) == coordinates.size, 'arm_coordinates, which come twice')


def put_residual_gp(residual_gp: ResidualGP, arrays: Arrays) -> dict[str, Any]:
    """Add the arrays of a residual GP; return its entry in the header."""
    arrays |= {f'remainder_{name}': getattr(residual_gp, name) for name in RESIDUAL_GP}
    arrays |= {f'remainder_{name}': getattr(residual_gp.inputs, name) for name in INPUTS}
    arrays['remainder_x'] = residual_gp.x.astype(np.float16)
    arrays['remainder_alpha'] = residual_gp.alpha.astype(np.float32)
    return {'replaces': residual_gp.replaces.tolist()}


def residual_gp_from(arrays: Arrays, entry: Mapping[str, Any], types: Sequence[str]) -> ResidualGP:
    """
    Return a residual GP.

    KeyError, TypeError, ValueError, LipIdError if its parts contradict each other.
    """
    n, revolute = len(types), ~is_prismatic(types)
    count, width = len(arrays['remainder_x']), 3 * n + int(revolute.sum())
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(
        ('noise', 'variance', 'left_out_std', 'sign_width'), (n,)
    )
    shapes |= {'x': (count, width), 'lengths': (n, width), 'alpha': (count, n), 'friction': (n, 3)}
    shapes |= {'centre': (width,), 'scale': (width,)}
    expect(arrays, {f'remainder_{name}': shape for name, shape in shapes.items()})
    require_positive(arrays, 'remainder_scale', 'remainder_sign_width')
    lengths = arrays['remainder_lengths']  # zero where a joint has no process
    given = (lengths > 0.0).all(axis=1) | (lengths == 0.0).all(axis=1)
    require(bool(given.all()), 'remainder_lengths, of which some are not positive')
    deviations = ('remainder_noise', 'remainder_variance', 'remainder_left_out_std')
    require_positive(arrays, *deviations, zero=True)
    replaces = np.array(entry['replaces'], dtype=np.bool_)
    if replaces.shape != (n,):
        raise ShapeError(f'replaces of shape {replaces.shape} for {n} joints')
    inputs = Inputs(revolute, *(arrays[f'remainder_{name}'] for name in INPUTS))
    own = {name: arrays[f'remainder_{name}'].astype(np.float64) for name in RESIDUAL_GP}
    return ResidualGP(inputs=inputs, replaces=replaces, **own)


def put_known_states(known: KnownStates | None, arrays: Arrays) -> None:
    """Add the arrays of training states that are kept, where there are some."""
    if known is not None:
        values = known.states.astype(np.float16), known.scale, np.array([known.left_out])
        arrays |= dict(zip(KNOWN_STATES, values, strict=True))


def known_states_from(arrays: Arrays, types: Sequence[str]) -> KnownStates | None:
    """Return the training states of a file, None without; errors as from `arm_from`."""
    if not any(name in arrays for name in KNOWN_STATES):
        return None
    width = 3 * len(types)
    count = len(arrays['known_states'])
    expect(arrays, dict(zip(KNOWN_STATES, ((count, width), (width,), (1,)), strict=True)))
    require(count > 0, 'known_states, of which there are none')
    require_positive(arrays, 'known_scale', 'known_left_out')
    states, scale, left_out = (arrays[name].astype(np.float64) for name in KNOWN_STATES)
    return KnownStates(states, scale, float(left_out[0]))


def put_process(process: TorquePosterior, arrays: Arrays) -> dict[str, Any]:
    """Add the arrays of a Gaussian process posterior; return its entry in the header."""
    prior, kernel = process.prior, process.prior.kernel
    arrays |= {
        'q': process.states.q,
        'dq': process.states.dq,
        'ddq': process.states.ddq,
        'tau': process.tau,
        'alpha': process.alpha,
        'noise_variance': prior.hyperparameters.noise_variance,
        'basis_centre': kernel.basis.centre,
        'basis_half_range': kernel.basis.half_range,
    }
    for name, values in prior.hyperparameters.weights._asdict().items():
        arrays[f'weights_{name}'] = values
    if kernel.friction is not None and prior.hyperparameters.friction is not None:
        arrays['friction_parameters'] = prior.hyperparameters.friction
        arrays['friction_sign_width'] = kernel.friction.sign_width
    return {
        'kernel': kernel.energy.name,
        'potential_links': kernel.energy.potential_links.tolist(),
        'friction': kernel.friction is not None,
        'inflation': process.inflation,
    }


def process_from(
    arrays: Arrays, entry: Mapping[str, Any], types: Sequence[str]
) -> TorquePosterior:
    """Return a Gaussian process posterior; errors as from `arm_from`."""
    energy = _energy_kernel(entry, len(types))
    has_friction = bool(entry['friction'])
    shapes = _process_shapes(energy, has_friction)
    expect(arrays, shapes)
    scales = ('noise_variance', 'basis_half_range', 'friction_sign_width')
    require_positive(arrays, *(name for name in scales if name in shapes))
    require_positive(arrays, *(name for name in shapes if name.startswith('weights_')), zero=True)
    basis = JointBasis(tuple(types), arrays['basis_centre'], arrays['basis_half_range'])
    friction = FrictionKernel(arrays['friction_sign_width']) if has_friction else None
    kernel = TorqueKernel(energy, basis, friction)
    hyperparameters = Hyperparameters(
        weights=Weights(*(arrays[f'weights_{name}'] for name in Weights._fields)),
        friction=arrays['friction_parameters'] if has_friction else None,
        noise_variance=arrays['noise_variance'],
    )
    states = kernel.states(arrays['q'], arrays['dq'], arrays['ddq'])
    expect(arrays, {'tau': states.q.shape, 'alpha': states.q.shape})
    prior = TorquePrior(kernel, hyperparameters)
    inflation = float(entry['inflation'])
    require(np.isfinite(inflation) and inflation > 0.0, f'an inflation of {inflation}')
    return TorquePosterior(prior, states, arrays['tau'], arrays['alpha'], inflation)


def _process_shapes(energy: EnergyKernel, has_friction: bool) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the arrays of a process: compiled loops do not check them."""
    n = energy.n_joints
    shapes: dict[str, tuple[int, ...]] = dict.fromkeys(
        ('basis_centre', 'basis_half_range', 'noise_variance'), (n,)
    )
    weights = unit_weights(energy)._asdict()
    shapes |= {f'weights_{name}': values.shape for name, values in weights.items()}
    if has_friction:
        shapes |= {'friction_parameters': (n, 3), 'friction_sign_width': (n,)}
    return shapes


def _energy_kernel(entry: Mapping[str, Any], n_joints: int) -> EnergyKernel:
    return with_potential_after(FAMILY[entry['kernel']](n_joints), entry['potential_links'])


def put_parts(
    arm: ArmPosterior | None,
    residual_gp: ResidualGP | None,
    process: TorquePosterior | None,
    arrays: Arrays,
) -> dict[str, Any]:
    """Add the arrays of what a model is made of; return their entries in the header."""
    return {
        'arm': None if arm is None else put_arm(arm, arrays),
        'remainder': None if residual_gp is None else put_residual_gp(residual_gp, arrays),
        'process': None if process is None else put_process(process, arrays),
    }


def of_present_format(arrays: Arrays, header: Mapping[str, Any]) -> None:
    """Add what a file of format 7 lacks: it knows no coupled positions."""
    if header['version'] == 7 and header['arm'] is not None:
        arrays['arm_couplings'] = NO_COUPLINGS


def parts_from(arrays: Arrays, header: Mapping[str, Any], types: Sequence[str]) -> dict[str, Any]:
    """
    Return what a model is made of, by names of `InverseDynamicsModel`.

    Errors as from `arm_from`.
    """
    readers = {'arm': arm_from, 'remainder': residual_gp_from, 'process': process_from}
    names = [name for name in readers if header[name] is not None]
    if names not in (['arm'], ['arm', 'remainder'], ['process']):
        raise ValueError(f'parts {names}, neither an arm nor a process')
    fields = {'remainder': 'residual_gp'}
    return {fields.get(name, name): readers[name](arrays, header[name], types) for name in names}
