"""From a model file to something that answers, or a sentence that says why not."""

from __future__ import annotations

from collections.abc import Sequence
import os

import numpy as np

from lip_id_ros.errors import ModelError
from lip_id_ros.runtime.feedforward import Feedforward
from lip_id_ros.runtime.limits import limits_by_name, TorqueLimits
from lip_id_ros.runtime.settings import ServeSettings
from lip_id_ros.serving import Predictor, TrainedModel


def load_feedforward(path: str, joints: Sequence[str]) -> Feedforward:
    """
    Load a model and let it answer, so that what is compiled on first use is compiled now.

    Parameters
    ----------
    path : str
        The model's file.
    joints : sequence of str
        Joints that it must have, in any order; empty for any.

    Raises
    ------
    OSError
        If the file cannot be opened.
    ModelError
        If it is not a model, or its joints are not those expected.

    """
    model = TrainedModel.load(path)
    require_joints(model.joint_names, joints, path)
    predictor = Predictor(model)
    rest = np.zeros((1, model.n_joints))
    predictor.query(rest[0], rest[0], rest[0])
    predictor.predict(rest, rest, rest)
    return Feedforward(predictor, model.joint_names)


def make_limits(settings: ServeSettings, joint_names: Sequence[str]) -> TorqueLimits:
    """
    Make the limits of a model's joints.

    Raises
    ------
    ConfigError
        If their number is not that of the joints.

    """
    limits = limits_by_name(settings.torque_limits, settings.joints, joint_names)
    return TorqueLimits(limits, settings.output_scale)


def require_joints(
    found: Sequence[str], expected: Sequence[str], path: str | os.PathLike[str]
) -> None:
    """
    Refuse a model of another robot.

    Parameters
    ----------
    found : sequence of str
        Joints of the model.
    expected : sequence of str
        Joints that it must have, in any order; empty for any.
    path : path
        The model's file, for the sentence.

    Raises
    ------
    ModelError
        If the joints differ.

    """
    if expected and set(found) != set(expected):
        raise ModelError(
            f'{os.fspath(path)} must be a model of the joints {", ".join(expected)}, but has '
            f'{", ".join(found)}; fit one for this robot or correct the parameter joints.'
        )
