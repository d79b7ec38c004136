"""A real model, fitted in a second or two and shared by all tests of a run."""

from __future__ import annotations

from functools import cache

from simulation.pendulums import swing

from lip_id_ros.dataset import Dataset
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.settings import FitSettings

QUICK = FitSettings(kernel='recursive', subset=25, max_samples=50, iterations=10)


@cache
def training() -> Dataset:
    return swing(1)


@cache
def small_model() -> InverseDynamicsModel:
    return fit(training(), QUICK)
