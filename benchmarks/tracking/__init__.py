"""The paper's tracking experiment, on a simulated arm (section `sec:control_exp`)."""

from benchmarks.tracking.experiment import (
    Experiment,
    INFORMED,
    LEARNED,
    NOMINAL,
    run_experiment,
    Trial,
    trials,
)
from benchmarks.tracking.figures import Figures, figures

__all__ = [
    'INFORMED',
    'LEARNED',
    'NOMINAL',
    'Experiment',
    'Figures',
    'Trial',
    'figures',
    'run_experiment',
    'trials',
]
