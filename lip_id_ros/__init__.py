"""
Inverse dynamics of robot arms, learned from recordings.

`import lip_id_ros as lip` gives what a script or notebook needs (python.md). Names are
imported when they are first used, so that the import itself is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from lip_id_ros.adaptation.adaptation import Adaptation
    from lip_id_ros.adaptation.followed import WalkSettings
    from lip_id_ros.dataset import Dataset
    from lip_id_ros.errors import (
        ConfigError,
        DataError,
        FitError,
        LipIdError,
        ModelError,
        ShapeError,
        SourceError,
    )
    from lip_id_ros.evaluation import evaluate, Evaluation, fit_cautions
    from lip_id_ros.excitation.planning import design_motion, ExcitingMotion
    from lip_id_ros.excitation.settings import (
        ExcitationConfig,
        MotionSettings,
        SearchSettings,
        SpaceSettings,
        TargetSettings,
    )
    from lip_id_ros.feedforward.interpolation import Plan
    from lip_id_ros.feedforward.plan_check import check_plan, PlanCheck
    from lip_id_ros.feedforward.plan_files import read_plans
    from lip_id_ros.loading.examined import load_dataset
    from lip_id_ros.model import InverseDynamicsModel, Prediction
    from lip_id_ros.settings import (
        Config,
        FitSettings,
        PreprocessingSettings,
        read_config,
        RecordingSettings,
    )
    from lip_id_ros.workflow.fit import fit

__version__ = '0.1.0'

_HOMES = {
    'Adaptation': 'adaptation.adaptation',
    'Config': 'settings',
    'ConfigError': 'errors',
    'DataError': 'errors',
    'Dataset': 'dataset',
    'Evaluation': 'evaluation',
    'ExcitationConfig': 'excitation.settings',
    'ExcitingMotion': 'excitation.planning',
    'FitError': 'errors',
    'FitSettings': 'settings',
    'InverseDynamicsModel': 'model',
    'LipIdError': 'errors',
    'ModelError': 'errors',
    'Plan': 'feedforward.interpolation',
    'PlanCheck': 'feedforward.plan_check',
    'Prediction': 'model',
    'MotionSettings': 'excitation.settings',
    'PreprocessingSettings': 'settings',
    'RecordingSettings': 'settings',
    'SearchSettings': 'excitation.settings',
    'ShapeError': 'errors',
    'SourceError': 'errors',
    'SpaceSettings': 'excitation.settings',
    'TargetSettings': 'excitation.settings',
    'WalkSettings': 'adaptation.followed',
    'check_plan': 'feedforward.plan_check',
    'design_motion': 'excitation.planning',
    'evaluate': 'evaluation',
    'fit': 'workflow.fit',
    'fit_cautions': 'evaluation',
    'load_dataset': 'loading.examined',
    'read_config': 'settings',
    'read_plans': 'feedforward.plan_files',
}
"""The room of every public name."""

__all__ = [
    'Adaptation',
    'Config',
    'ConfigError',
    'DataError',
    'Dataset',
    'Evaluation',
    'ExcitationConfig',
    'ExcitingMotion',
    'FitError',
    'FitSettings',
    'InverseDynamicsModel',
    'LipIdError',
    'ModelError',
    'MotionSettings',
    'Plan',
    'PlanCheck',
    'Prediction',
    'PreprocessingSettings',
    'RecordingSettings',
    'SearchSettings',
    'ShapeError',
    'SourceError',
    'SpaceSettings',
    'TargetSettings',
    'WalkSettings',
    '__version__',
    'check_plan',
    'design_motion',
    'evaluate',
    'fit',
    'fit_cautions',
    'load_dataset',
    'read_config',
    'read_plans',
]


def __getattr__(name: str) -> Any:
    """Import a public name from its room."""
    if name not in _HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(import_module(f'{__name__}.{_HOMES[name]}'), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return sorted(__all__)
