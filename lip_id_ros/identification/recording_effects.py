"""
Friction that differs between recordings: a linear mixed model (maths.md, section 13).

Drives warm up and offsets drift. Viscous and Coulomb coefficients and offsets of a recording are
normal around those of the arm, with deviations of restricted maximum likelihood, as in a fleet. A
prediction is for a recording that is not known, so that its deviation has theirs in it.

"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import norm, t

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.friction.compiled import friction_features
from lip_id_ros.friction.terms import Coulomb, Offset, Viscous
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter
from lip_id_ros.identification.arm_search import CHUNK
from lip_id_ros.identification.friction_deviations import LEAST_GROUPS, NestedEffects
from lip_id_ros.identification.link_torques import links_torque
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

INITIAL = 0.05
"""First deviation, as a share of the torque's."""

LEAST_WITHIN = 0.1
"""Least share of the noise's variance within a recording."""

VARYING = (Viscous, Coulomb, Offset)


def recording_deviations(fitter: ArmFitter, fit: ArmFit, inflation: float) -> Array:
    """
    Estimate the deviations of friction coefficients between recordings.

    Parameters
    ----------
    fitter : ArmFitter
    fit : ArmFit
        To all recordings together.
    inflation : float
        By which samples count for less than their number, since residuals are correlated.

    Returns
    -------
    array, shape (K,)
        In the units of the coefficients; 0 where a term does not vary, and with fewer than
        `LEAST_GROUPS` recordings.

    """
    dataset, basis = fitter.dataset, fit.friction.basis
    out = np.zeros(basis.size)
    numbers = np.unique(dataset.recording)
    if numbers.size < LEAST_GROUPS:
        return out
    each = [_normal_equations(fitter, fit, dataset.recording == number) for number in numbers]
    normal, right = (np.array(some) for some in zip(*each, strict=True))
    for joint in range(dataset.n_joints):
        own = _varying(fit, joint)
        block = normal[:, joint][:, own][:, :, own] / inflation
        size = np.sqrt(np.diagonal(block.sum(axis=0)) * inflation / dataset.n_samples)
        start = INITIAL / np.where(size > 0.0, size, 1.0) * fitter.torque_std[joint]
        start /= fit.noise.std[joint]
        effects = NestedEffects(block, right[:, joint, own] / inflation, np.arange(numbers.size))
        out[own] = effects.estimated(start).recordings
    return out


def _normal_equations(fitter: ArmFitter, fit: ArmFit, some: BoolArray) -> tuple[Array, Array]:
    """Return F^T F and F^T r of every joint in units of the noise, (n, K, K) and (n, K)."""
    n, size = fitter.dataset.n_joints, fit.friction.basis.size
    normal, right = np.zeros((n, size, size)), np.zeros((n, size))
    rows = np.flatnonzero(some)
    for chunk in np.array_split(rows, -(-rows.size // CHUNK)):
        part = fitter.dataset.select(chunk)
        load = links_torque(fit.chain, fit.links, part)
        state = part.q, part.dq, part.ddq, load, part.low_passed_sign
        residual = part.tau - load - fit.friction.torque(*state)
        scale = np.sqrt(fit.noise.weights(part.dq)) / fit.noise.std
        features = friction_features(fit.friction.basis, *state) * scale[..., None]
        features = np.ascontiguousarray(features.transpose(1, 0, 2))
        normal += features.transpose(0, 2, 1) @ features
        right += np.einsum('itk,ti->ik', features, residual * scale)
    return normal, right


def with_recordings(
    arm: ArmPosterior, deviations: Array, n_recordings: int, dq: Array
) -> ArmPosterior:
    """
    Return an arm whose deviations are those of a recording that is not known.

    What differs between recordings is no noise any more.

    Parameters
    ----------
    arm : ArmPosterior
    deviations : array, shape (K,)
        Of `recording_deviations`.
    n_recordings : int
        From which they were estimated.
    dq : array, shape (N, n)
        Of the training samples.

    """
    varying = np.flatnonzero(deviations)
    if not varying.size:
        return arm
    first = (DIRECTIONS + LINK_PARAMETERS) * len(arm.links)
    columns = np.zeros((len(arm.covariance_root), varying.size))
    columns[first + varying, np.arange(varying.size)] = deviations[varying] * widening(
        n_recordings
    )
    zero = np.zeros_like(dq)
    features = friction_features(arm.friction.basis, zero, dq, zero, zero)
    between = np.mean(np.sum((features * deviations) ** 2, axis=2), axis=0)
    variance = arm.noise.std**2
    std = np.sqrt(np.maximum(variance - between, LEAST_WITHIN * variance))
    return replace(
        arm,
        noise=replace(arm.noise, std=std),
        covariance_root=np.hstack([arm.covariance_root, columns]),
    )


def widening(n_recordings: int) -> float:
    """
    Return the factor of a deviation between recordings with which two of them cover a new one.

    The mean of few recordings is not known exactly, nor is their deviation: Student's t.

    """
    two = t.ppf(norm.cdf(2.0), n_recordings - 1)
    return float(0.5 * two * np.sqrt(1.0 + 1.0 / n_recordings))


def _varying(fit: ArmFit, joint: int) -> list[int]:
    """Return the coefficients of a joint that differ between recordings."""
    basis = fit.friction.basis
    return [
        place.start
        for part, place in zip(basis.terms, basis.slices, strict=True)
        if part.drive.joints == (joint,) and isinstance(part.term, VARYING)
    ]
