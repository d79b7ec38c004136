"""Fit a model to recordings and judge it on unseen samples, or identify a payload."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from lip_id_ros import identification
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import (
    data_remarks,
    evaluate,
    Evaluation,
    evaluation_cautions,
    fit_cautions,
    matched,
)
from lip_id_ros.export.payload import (
    attached,
    mass_cautions,
    payload_in_flange,
    residual_gp_cautions,
)
from lip_id_ros.identification.fitting import check
from lip_id_ros.identification.folds import new_motion_s
from lip_id_ros.identification.payload import identify_payload, Payload
from lip_id_ros.loading.data_settings import settings_of
from lip_id_ros.loading.examined import load_dataset
from lip_id_ros.loading.load import PathLike
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.proof import with_held_out
from lip_id_ros.preprocessing import for_training
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import Config, FitSettings


@dataclass(frozen=True, eq=False)
class Learned:
    """A model, and its errors on what was held out, where anything was."""

    model: InverseDynamicsModel
    evaluation: Evaluation | None = None

    @property
    def cautions(self) -> list[str]:
        """What was unusual about recordings, fit and errors, in sentences."""
        return fit_cautions(self.model, self.evaluation)


def learn_from(
    sources: PathLike | Sequence[PathLike],
    config: Config,
    holdout: float = 0.0,
    progress: Progress = silent,
) -> Learned:
    """Load recordings together and `learn`; raises what `load_dataset` and `learn` raise."""
    data = load_dataset(sources, config, progress, 1.0 - holdout)
    return learn(data, config, holdout, progress)


def learn(
    data: Dataset, config: Config, holdout: float = 0.0, progress: Progress = silent
) -> Learned:
    """
    Fit a model without the last share `holdout` of the samples, and judge it by them.

    Samples near rest are left out of the fit where its kernel or the settings ask for that, and
    judged all the same. DataError, ConfigError and FitError as from `fit`.
    """
    training, held_out = data.split(1.0 - holdout) if holdout > 0.0 else (data, None)
    training = for_training(training, config.preprocessing, config.fit.kernel)
    model = identification.fit(training, config.fit, progress)
    if held_out is None:
        return Learned(model)
    return Learned(*judged(model, training, held_out, progress))


def judged(
    model: InverseDynamicsModel, training: Dataset, held_out: Dataset, progress: Progress = silent
) -> tuple[InverseDynamicsModel, Evaluation]:
    """Return the model with its errors on held-out samples in the summary, and those errors."""
    evaluation = evaluate(model, held_out, progress)
    new_s = new_motion_s(matched(training, model), matched(held_out, model))
    return with_held_out(model, evaluation.nmse_percent, new_s), evaluation


def fit(
    dataset: Dataset, settings: FitSettings | None = None, progress: Progress = silent
) -> InverseDynamicsModel:
    """
    Fit a model to a data set.

    Samples near rest are left out as `lip_id fit` leaves them out, by `min_velocity` of the
    settings that the data set was preprocessed with.

    Parameters
    ----------
    dataset : Dataset
        In the order of time.
    settings : FitSettings, optional
        With the kernel 'articulated', the default, an arm is identified; every other kernel is a
        Gaussian process on energies.
    progress : callable

    Raises
    ------
    ConfigError
        If a robot description is given to another model than an articulated one.
    DataError
        If there are too few samples, a torque never changes, or the robot description is of
        another arm.
    FitError
        If the data are not finite, or a Gram matrix cannot be factorised.

    """
    settings = FitSettings() if settings is None else settings
    check(dataset, settings)
    preprocessing = settings_of(dataset.provenance).preprocessing
    return learn(dataset, Config(preprocessing=preprocessing, fit=settings), 0.0, progress).model


@dataclass(frozen=True, eq=False)
class FoundPayload:
    """A payload in the robot's flange, the model of the arm with it, and cautions in sentences."""

    payload: Payload
    model: InverseDynamicsModel
    cautions: list[str]


def find_payload(
    model: InverseDynamicsModel, data: Dataset, flange: tuple[float, float] = (0.0, 0.0)
) -> FoundPayload:
    """
    Identify the payload of an arm whose model is known.

    `data`: of the arm with its payload, with the model's joints in its order. `flange`: its frame
    in that of the last link, as `payload_in_flange` takes it. DataError and FitError as from
    `identify_payload`.
    """
    found = identify_payload(model, data)
    shown, loaded = payload_in_flange(found, *flange), attached(model, found)
    cautions = [
        *data_remarks(data.provenance),
        *mass_cautions(shown.mass, shown.mass_std),
        *residual_gp_cautions(model),
        *evaluation_cautions(evaluate(loaded, data)),
    ]
    return FoundPayload(shown, loaded, cautions)
