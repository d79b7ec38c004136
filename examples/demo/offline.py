"""
The demonstration without ROS: a simulated Panda is recorded, learned and judged on a new motion.

Two bags are written as a driver would have recorded them; one is learned from, the other shows
what the model is worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
import shutil
import sys

import numpy as np

from examples.demo.reporting import REPORT, report, run_demo
from lip_id_ros.cli.output import progress_display
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import Evaluation, run
from lip_id_ros.loading import load_dataset
from lip_id_ros.settings import Config
from lip_id_ros.simulation import (
    make_dataset,
    MotionLimits,
    panda,
    SimulatedArm,
    SinusoidTrajectory,
    with_encoder_noise,
    with_truth,
    write_bag,
)
from lip_id_ros.simulation.arm import MOTION, N_JOINTS
from lip_id_ros.workflow.fit import learn_from

RATE_HZ = 100.0
POSITION_NOISE = 2e-5  # rad
VELOCITY_NOISE = 1e-3  # rad/s
TORQUE_NOISE = 0.05  # N m
TRAINING_SEED, TEST_SEED = 1, 2
TRAINING_BAG, TEST_BAG = 'training_bag', 'test_bag'
MODEL = 'panda.npz'


@dataclass(frozen=True)
class Size:
    """How much the demonstration does: joints, and seconds of each motion."""

    n_joints: int = N_JOINTS
    duration: float = 50.0


@dataclass(frozen=True)
class Simulation:
    """A recorded motion of the simulated arm, and what really happened."""

    arm: SimulatedArm
    trajectory: SinusoidTrajectory
    bag: Path

    def with_truth(self, measured: Dataset) -> Dataset:
        """Put the true torques and energies beside what was read from the bag."""
        return with_truth(measured, self.arm, self.trajectory)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demonstration; return the exit status of `run_demo`."""
    return run_demo(lambda output: demonstrate(output, Size(), Config()), argv, __doc__)


def demonstrate(output: Path, size: Size, config: Config) -> Evaluation:
    """
    Record, fit, evaluate on a motion that the model has not seen, and report.

    The output folder gets two bags, the model and the report.
    """
    output.mkdir(parents=True, exist_ok=True)
    with progress_display() as progress:
        training = record(output / TRAINING_BAG, TRAINING_SEED, size)
        test = record(output / TEST_BAG, TEST_SEED, size)
        model = learn_from([training.bag], config, progress=progress).model
        model.save(output / MODEL)
        unseen = test.with_truth(load_dataset([test.bag], config, progress))
        facts = (
            ('motion', 'sums of 50 sinusoids up to 1 Hz; training and test drawn independently'),
            ('noise on measured torques', f'{TORQUE_NOISE} N m'),
        )
        return report(output / REPORT, model, run(model, unseen, progress), facts, progress)


def record(bag: Path, seed: int, size: Size) -> Simulation:
    """Move the arm and write its measurements into a bag; an older bag is replaced."""
    rng = np.random.default_rng(seed)
    arm = panda(size.n_joints)
    limits: MotionLimits = MOTION.first(size.n_joints)
    trajectory = SinusoidTrajectory.random(limits, rng)
    t = np.arange(0.0, size.duration, 1 / RATE_HZ)
    exact = make_dataset(arm, trajectory, t, TORQUE_NOISE, rng)
    shutil.rmtree(bag, ignore_errors=True)
    write_bag(bag, with_encoder_noise(exact, POSITION_NOISE, VELOCITY_NOISE, rng))
    return Simulation(arm, trajectory, bag)


if __name__ == '__main__':
    sys.exit(main())
