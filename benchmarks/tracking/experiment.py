"""The tracking experiment: learn under a wrong nominal model, then follow references."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from benchmarks._changed_arms import with_wrong_masses
from benchmarks._closed_loop import (
    ComputedTorque,
    Feedforward,
    FrictionalArm,
    LearnedFeedforward,
    NominalFeedforward,
    placed,
    track,
    Tracking,
)
from lip_id_ros.dataset import Dataset
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import FitSettings, PreprocessingSettings
from lip_id_ros.simulation import GrowingCosine
from lip_id_ros.simulation.torque_controlled import Setup
from lip_id_ros.workflow.fit import fit

LEARNED, NOMINAL, INFORMED = 'learned', 'nominal', 'nominal with friction'


@dataclass(frozen=True)
class Experiment:
    """
    Variations and lengths of the experiment; the defaults are the paper's where it has them.

    Attributes
    ----------
    mass_share, centre_shift : float
        The nominal masses are wrong by up to this share, centres of mass by so much [m] per axis.
    horizon : float
        Length of a run [s].
    amplitude, amplitudes : float, tuple of float
        Of the run that is learned from, and of those that are compared [rad].
    preprocessing : PreprocessingSettings
        A cut-off of 12.5 Hz keeps about 50 samples per second of the 1000, as the paper does.

    """

    mass_share: float = 0.2
    centre_shift: float = 0.02
    horizon: float = 10.0
    amplitude: float = 0.5
    amplitudes: tuple[float, ...] = (0.5, 0.6)
    preprocessing: PreprocessingSettings = field(
        default_factory=lambda: PreprocessingSettings(cutoff_hz=12.5, max_samples=500)
    )
    fit: FitSettings = field(default_factory=FitSettings)


@dataclass(frozen=True, eq=False)
class Trial:
    """
    One wrong nominal model, and what was learned under it.

    `seed` is that of the nominal model's errors and of all noise; `runs` are keyed by amplitude
    [rad] and feedforward: `LEARNED`, `NOMINAL`, or `INFORMED`, the nominal model with the exact
    friction and rotors.

    """

    seed: int
    model: InverseDynamicsModel
    runs: dict[tuple[float, str], Tracking]


def run_experiment(
    setup: Setup, experiment: Experiment, seed: int, progress: Progress = silent
) -> Trial:
    """Run the experiment for one nominal model; the seed is that of its errors and all noise."""
    chance = np.random.default_rng(seed)
    wrong = with_wrong_masses(setup.arm, experiment.mass_share, experiment.centre_shift, chance)
    nominal = NominalFeedforward(wrong)
    training = _follow(setup, nominal, experiment, experiment.amplitude, chance, progress)
    model = fit(recorded(training, setup, experiment), experiment.fit, progress)
    feedforwards: dict[str, Feedforward] = {
        LEARNED: LearnedFeedforward(model),
        NOMINAL: nominal,
        INFORMED: NominalFeedforward(
            FrictionalArm(
                wrong.with_rotor_inertia(setup.drives.rotor_inertia), setup.drives.friction
            )
        ),
    }
    runs = {
        (amplitude, name): _follow(setup, feedforward, experiment, amplitude, chance, progress)
        for amplitude in experiment.amplitudes
        for name, feedforward in feedforwards.items()
    }
    return Trial(seed, model, runs)


def recorded(run: Tracking, setup: Setup, experiment: Experiment) -> Dataset:
    """Preprocess what the sensors measured."""
    samples = JointSamples(
        run.t, run.q, run.dq, run.tau, setup.arm.joint_names, source='the simulated run'
    )
    return preprocess(samples, experiment.preprocessing)


def trials(
    setup: Setup, experiment: Experiment, seeds: int, progress: Progress = silent
) -> Iterator[Trial]:
    """Run the experiment with seeds 0, 1, ..., one after the other."""
    for seed in range(seeds):
        progress('nominal models', seed, seeds)
        yield run_experiment(setup, experiment, seed, progress)


def _follow(
    setup: Setup,
    feedforward: Feedforward,
    experiment: Experiment,
    amplitude: float,
    chance: np.random.Generator,
    progress: Progress,
) -> Tracking:
    reference = GrowingCosine(setup.posture, amplitude, experiment.horizon)
    simulated = placed(setup.arm, setup.drives, reference, chance)
    controller = ComputedTorque(feedforward, setup.gains)
    return track(simulated, controller, reference, experiment.horizon, progress=progress)
