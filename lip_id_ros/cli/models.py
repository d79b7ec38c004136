"""A model from its file, and the settings with which data are read for it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
import os
from typing import Any

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError, missing_joints, ModelError
from lip_id_ros.evaluation import fit_cautions, matched
from lip_id_ros.loading import load_dataset, with_selected
from lip_id_ros.loading.data_settings import settings_of
from lip_id_ros.loading.examined import load_dataset as load_dataset_examined
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.serialization import contradictions
from lip_id_ros.progress import Progress
from lip_id_ros.settings import Config, override, read_config, RecordingSettings


def load(path: str) -> InverseDynamicsModel:
    """Read a model; ModelError if the file is damaged or no model."""
    if os.path.isdir(path):
        raise ModelError(
            f'{path} must be a model that `lip_id fit` wrote, but is a folder; name the model '
            'first, and recordings after it.'
        )
    model = InverseDynamicsModel.load(path)
    with contradictions(path):  # a hash can be computed anew for any summary and provenance
        _config_of(model, None)
        fit_cautions(model)
    return model


def load_for(
    model: InverseDynamicsModel, sources: list[str], path: str | None, progress: Progress
) -> Dataset:
    """
    Read recordings for a model, with its joints in its order.

    Without a settings file, by the settings of the first recording of the fit.
    """
    return matched(load_dataset(sources, _config_of(model, path), progress), model)


def load_examined(
    model: InverseDynamicsModel, sources: list[str], path: str | None, progress: Progress
) -> Dataset:
    """Read recordings as `load_for` does, to learn from them: with findings about them."""
    return matched(load_dataset_examined(sources, _config_of(model, path), progress), model)


def fit_config(args: argparse.Namespace) -> Config:
    """Return the settings of `lip_id fit`: those of the file, then those of the command line."""
    chosen = {
        'recording.joints': args.joints,
        'fit.kernel': args.kernel,
        'fit.description': args.urdf,
        'fit.seed': args.seed,
    }
    return chosen_config(args.config, chosen)


def chosen_config(path: str | None, chosen: Mapping[str, Any]) -> Config:
    """Return the settings of a file, and those of the command line that are not None."""
    config = Config() if path is None else read_config(path)
    given = {name: value for name, value in chosen.items() if value is not None}
    return override(config, given, 'the command line')


def _config_of(model: InverseDynamicsModel, path: str | None) -> Config:
    config = settings_of(model.provenance) if path is None else read_config(path)
    config = with_selected(config, model.provenance)
    return replace(config, recording=_recording_of(model, config.recording))


def _recording_of(model: InverseDynamicsModel, recording: RecordingSettings) -> RecordingSettings:
    named = recording.joints or model.joint_names
    if missing := [name for name in model.joint_names if name not in named]:
        raise ConfigError(missing_joints(missing, 'recording.joints', named))
    columns = [named.index(name) for name in model.joint_names]
    ordered: dict[str, Any] = {}
    for field in ('effort_scale', 'effort_offset', 'effort_delay_s'):
        values = getattr(recording, field)
        if len(values) == len(named):  # else preprocessing refuses them
            ordered[field] = tuple(values[column] for column in columns)
    return replace(recording, joints=model.joint_names, joint_types=model.joint_types, **ordered)
