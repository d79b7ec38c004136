"""
The quality of a model on a data set: figures, tables, plots and cautions.

Names are imported when they are first used: what describes recordings needs no models.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from lip_id_ros.evaluation.cautions import (
        data_remarks,
        evaluation_cautions,
        fit_cautions,
    )
    from lip_id_ros.evaluation.metrics import evaluate, Evaluation, score
    from lip_id_ros.evaluation.prediction import matched, Outcome, run

__all__ = [
    'Evaluation',
    'Outcome',
    'data_remarks',
    'evaluate',
    'evaluation_cautions',
    'fit_cautions',
    'matched',
    'run',
    'score',
]


def __getattr__(name: str) -> Any:
    """Import a public name from its module."""
    for module in ('cautions', 'metrics', 'prediction') if name in __all__ else ():
        found = vars(import_module(f'{__name__}.{module}'))
        if name in found:
            return found[name]
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
