"""Load a model file for serving, or refuse it with a sentence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.errors import ModelError
from lip_id_ros.feedforward.deviations import Deviations
from lip_id_ros.feedforward.rules import make_rules, require_consistent, TrainingRange
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.model import DynamicsModel, EffortCalibration, InverseDynamicsModel
from lip_id_ros.signals.joints import require_joints


@dataclass(frozen=True, eq=False)
class LoadedModel:
    """
    A model, ready to be served.

    Attributes
    ----------
    model : DynamicsModel
    training_range : TrainingRange
    calibration : EffortCalibration
        Of the effort that it was fitted to.
    deviations : Deviations, or None
        Where standard deviations are asked for.

    """

    model: DynamicsModel
    training_range: TrainingRange
    calibration: EffortCalibration
    deviations: Deviations | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints from base to tip."""
        return self.model.joint_names

    def stop(self) -> None:
        """End the processes that belong to the model."""
        if self.deviations is not None:
            self.deviations.stop()


def load_model(settings: ServeSettings, joints: Sequence[str]) -> LoadedModel:
    """
    Load a model and let it answer, so that what is compiled on first use is compiled now.

    Parameters
    ----------
    settings : ServeSettings
        The file, and whether standard deviations are needed.
    joints : sequence of str
        Joints that it must have, in any order; empty for any.

    Raises
    ------
    OSError
        If the file cannot be opened.
    ModelError
        If it is not a model, or its joints are not those expected.

    """
    path = settings.model_path
    model = InverseDynamicsModel.load(path)
    require_joints(model.joint_names, joints, path)
    rest = np.zeros((1, model.n_joints))
    model.query(rest[0], rest[0], rest[0])
    model.predict(rest, rest, rest)
    return LoadedModel(
        model,
        TrainingRange(*model.training_range),
        model.effort_calibration,
        Deviations(path, model.n_joints) if settings.needs_deviations else None,
    )


def load_successor(settings: ServeSettings, before: LoadedModel) -> LoadedModel:
    """
    Load a model that takes the place of another.

    Its joints must stand in the same order, so that lists of parameters and torques without names
    keep their meaning.

    Raises
    ------
    OSError
        If the file cannot be opened.
    ModelError
        If it is not a model, or its joints are not those of the other.

    """
    expected = before.joint_names
    loaded = load_model(settings, expected)
    found = loaded.joint_names
    if found == expected:
        return loaded
    loaded.stop()
    raise ModelError(
        f'{settings.model_path} must have its joints in the order {", ".join(expected)}, but has '
        f'{", ".join(found)}; clean the node up and configure it anew to change the order.'
    )


def require_rules(settings: ServeSettings, loaded: LoadedModel | None) -> None:
    """
    Refuse settings that do not fit the arm, or where there is none yet, its named joints.

    Raises
    ------
    ConfigError
        With the sentence.

    """
    joints = loaded.joint_names if loaded else settings.joints
    if joints:
        make_rules(settings, joints)
    else:
        require_consistent(settings)
