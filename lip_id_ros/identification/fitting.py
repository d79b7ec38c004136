"""From a data set to a model of inverse dynamics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
import time
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.description.urdf import load_description
from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.gp import fit_process
from lip_id_ros.identification.arm_fit import Described
from lip_id_ros.identification.arm_prior import DescriptionSettings
from lip_id_ros.identification.identify import Identified, identify, LEAST_SAMPLES_PER_JOINT
from lip_id_ros.identification.novelty import known_states, motion_report
from lip_id_ros.identification.posterior import ranges_of
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.effort_calibration import effort_calibrations
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.model.proof import with_checks
from lip_id_ros.progress import Progress, silent
from lip_id_ros.rigid_body.couplings import NO_COUPLING, read_couplings, rows_of
from lip_id_ros.rigid_body.denavit_hartenberg import PARAMETERS, table, UNITS, with_standard_frames
from lip_id_ros.settings import FitSettings

LEAST_SAMPLES = 10
LARGEST = 1e9
"""No position, velocity, acceleration or torque of an arm is larger, in SI units."""

ROUNDING = 1e-9
"""Share of the largest torque below which a change is none."""

OF_PROCESSES = ('friction', 'subset', 'max_samples', 'iterations', 'prior_precision')
OF_ARMS = ('seed', 'terms')
"""Settings that only fits of Gaussian processes, and only fits of arms, use."""

WITHOUT_LINKS = 'recursive'
"""Kernel of data sets with too few samples to identify an arm."""


def fit(
    dataset: Dataset, settings: FitSettings | None = None, progress: Progress = silent
) -> InverseDynamicsModel:
    """Fit a model to all samples of a data set; raises what `lip_id_ros.workflow.fit.fit` does."""
    settings = FitSettings() if settings is None else settings
    check(dataset, settings)
    started = time.monotonic()
    parts, report = _fitted(dataset, settings, progress)
    report['seconds_total'] = round(time.monotonic() - started, 3)
    process = parts.get('process')
    report |= motion_report(dataset)
    report['ignored_settings'] = _ignored(settings, OF_ARMS if process else OF_PROCESSES)
    model = InverseDynamicsModel(
        joint_names=dataset.joint_names,
        joint_types=dataset.joint_types,
        potential_reference=dataset.q.mean(axis=0),
        training_range=ranges_of(dataset),
        largest_torque=np.abs(dataset.tau).max(axis=0),
        n_samples=len(process.states) if process else dataset.n_samples,
        effort_calibrations=effort_calibrations(dataset.provenance, dataset.joint_names),
        known_states=known_states(dataset),
        summary=report,
        provenance={**dataset.provenance, 'n_samples_available': dataset.n_samples},
        **parts,
    )
    return with_checks(model, dataset.q, dataset.tau)


def _fitted(
    dataset: Dataset, settings: FitSettings, progress: Progress
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the parts of the model, and a report."""
    few = dataset.n_samples < LEAST_SAMPLES_PER_JOINT * dataset.n_joints
    couplings = known_couplings(settings, dataset.joint_names)
    if couplings is not None and (few or settings.kernel != ARTICULATED):
        raise ConfigError(
            f'fit.coupling is of the links of an articulated fit to at least '
            f'{LEAST_SAMPLES_PER_JOINT * dataset.n_joints} samples, but fit.kernel is '
            f'{settings.kernel} and there are {dataset.n_samples} samples; leave it empty, or '
            'change that.'
        )
    if settings.description and (few or settings.kernel != ARTICULATED):
        raise ConfigError(
            f'fit.description (--urdf) is the prior of an articulated fit to at least '
            f'{LEAST_SAMPLES_PER_JOINT * dataset.n_joints} samples, but fit.kernel is '
            f'{settings.kernel} and there are {dataset.n_samples} samples; leave it empty, or '
            'change that.'
        )
    if settings.kernel == ARTICULATED and not few:
        described = described_arm(dataset.joint_names, dataset.joint_types, settings)
        terms = settings.terms
        found = identify(dataset, settings.seed, progress, described, None, couplings, terms)
        report = fit_report(found, settings)
        if described is not None:
            report['description'] = description_report(found, described[0])
        return {'arm': found.arm, 'residual_gp': found.residual_gp}, report
    kernel = WITHOUT_LINKS if settings.kernel == ARTICULATED else settings.kernel
    fitted = fit_process(dataset, settings, kernel, progress)
    return {'process': fitted.posterior}, fitted.report


def _ignored(settings: FitSettings, names: tuple[str, ...]) -> list[str]:
    """Return those of some settings that are not at their defaults."""
    default = FitSettings()
    return [f'fit.{name}' for name in names if getattr(settings, name) != getattr(default, name)]


def fit_report(found: Identified, settings: FitSettings) -> dict[str, Any]:
    """Return the JSON-able summary of an arm that was identified."""
    joints = found.residual_gp.joints.tolist() if found.residual_gp else []
    return {
        'searches_agreed': found.searches_agreed,
        'descents': found.descents,
        'unexplained_left_out': found.unexplained.tolist(),
        'unpredicted_left_out': found.unpredicted.tolist(),
        'unexplained_of_all': found.unexplained_of_all.tolist(),
        'disturbed': found.disturbed.tolist(),
        'covariance_inflation': found.solution.inflation,
        'outliers': found.outliers,
        'halves_agree': found.halves_agree,
        'suspicions': found.suspicions,
        'disturbances': [asdict(each) for each in found.disturbances],
        'elected_twists_deg': _twists(found),
        'elected_meeting_axes': found.geometry.meets.tolist(),
        'denavit_hartenberg': _kinematics(found),
        'remainder': joints,
        'friction': [list(names) for names in found.arm.friction.names()],
        'friction_between_recordings': found.solution.deviations.recordings.tolist(),
        'noise_std': found.arm.noise.std.tolist(),
    }


def _kinematics(found: Identified) -> dict[str, list[float]]:
    """Return the parameters of Denavit and Hartenberg with their standard deviations."""
    chain, _ = with_standard_frames(found.arm.chain, found.arm.links)
    report: dict[str, Array] = {}
    for ending, values in (('', table(chain)), ('_std', found.kinematics_std)):
        columns = zip(PARAMETERS, UNITS, values.reported.T, strict=True)
        report |= {f'{name}{ending}_{unit}': column for name, unit, column in columns}
    # the sum makes 0 of -0
    return {name: (np.round(each, 5) + 0.0).tolist() for name, each in report.items()}


def known_couplings(settings: FitSettings, joint_names: Sequence[str]) -> Array | None:
    """Return the couplings of positions that the settings name, (k, 3); None to search for."""
    if not settings.coupling:
        return None
    texts = () if settings.coupling == (NO_COUPLING,) else settings.coupling
    return rows_of(read_couplings(texts, joint_names))


def described_arm(
    names: tuple[str, ...], types: tuple[str, ...], settings: FitSettings
) -> Described | None:
    """Return the robot description that the settings name, and how far it is trusted."""
    if not settings.description:
        return None
    trust = DescriptionSettings(
        angle_std=float(np.radians(settings.description_angle_deg)),
        distance_std=settings.description_distance_m,
        inertial_std=settings.description_inertial,
    )
    return load_description(settings.description, names, types), trust


def description_report(found: Identified, description: RobotDescription) -> dict[str, Any]:
    """Return the JSON-able summary of how the data agree with a robot description."""
    doubts = found.doubts
    assert doubts is not None, 'the arm was fitted with a description'
    return {
        'place': description.place,
        'fingerprint': description.fingerprint,
        'turns_deg': np.degrees(doubts.turns).tolist(),
        'shifts_m': doubts.shifts.tolist(),
        'deviations': doubts.deviations.tolist(),
        'corrections': list(doubts.corrections),
        'sentences': list(doubts.sentences),
    }


def _twists(found: Identified) -> list[float | None]:
    """Return the twists that were selected to be quarter turns, None where free [degrees]."""
    twists = np.degrees(found.geometry.twists)
    return [None if np.isnan(twist) else round(float(twist)) for twist in twists]


def check(dataset: Dataset, settings: FitSettings) -> None:
    """Refuse what no model can be fitted to, as `fit` does."""
    if not isinstance(dataset, Dataset):
        raise DataError(
            f'a fit needs a Dataset, not {type(dataset).__name__}; use load_dataset for files and '
            'Dataset.from_arrays for arrays.'
        )
    if not isinstance(settings, FitSettings):
        raise ConfigError(
            f'the settings of a fit must be FitSettings, not {type(settings).__name__}; write '
            'FitSettings(name=value).'
        )
    if dataset.n_samples < LEAST_SAMPLES:
        raise DataError(
            f'a fit needs at least {LEAST_SAMPLES} samples, but the data set has '
            f'{dataset.n_samples}; record longer or keep more samples in preprocessing.'
        )
    for name in ('q', 'dq', 'ddq', 'tau'):
        largest = float(np.abs(getattr(dataset, name)).max())
        if largest > LARGEST:
            raise DataError(
                f'{name} must be at most {LARGEST:g} as that of any arm, but goes up to '
                f'{largest:.3g}; correct its unit, or leave such samples out.'
            )
    changes = np.ptp(dataset.tau, axis=0) > ROUNDING * np.abs(dataset.tau).max()
    if not changes.all():
        raise DataError(_still(dataset, changes))


def _still(dataset: Dataset, changes: BoolArray) -> str:
    """Return a sentence on joints whose efforts never change."""
    named = list(zip(dataset.joint_names, changes, strict=True))
    still = ', '.join(repr(name) for name, moves in named if not moves)
    rest = [name for name, moves in named if moves]
    option = f': --joints {",".join(rest)}, or recording.joints in a configuration' if rest else ''
    return (
        f'efforts that change were expected, but in all {dataset.n_samples} samples those of '
        f'{still} are the same; check the effort signal, or leave out what is no joint of the arm '
        f'or did not move{option}.'
    )
